"""What a histogram counts: bin numbers of the pixels in a window of the image."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from sim.types import Array, Image

Labels = NDArray[np.int16]


@dataclass(frozen=True, slots=True)
class Window:
    """A rectangle of whole pixels inside an image."""

    left: int
    top: int
    right: int
    bottom: int

    @staticmethod
    def around(states: Array, radius: float, image: Image, more: float = 0.0) -> Window:
        """The part of the image within a radius (at scale 1) of any of the states (N, 4).

        Args:
            states: (N, 4).
            radius: Of the template [px].
            image: Its size bounds the window.
            more: How much farther the window goes [px].
        """
        reach = radius * np.exp(states[:, 3]) + more
        height, width = image.shape[:2]
        left = np.clip(np.floor(np.min(states[:, 0] - reach)), 0, width)
        right = np.clip(np.ceil(np.max(states[:, 0] + reach)), 0, width)
        top = np.clip(np.floor(np.min(states[:, 1] - reach)), 0, height)
        bottom = np.clip(np.ceil(np.max(states[:, 1] + reach)), 0, height)
        return Window(int(left), int(top), int(right), int(bottom))


class Bins(Protocol):
    """A way to turn pixels into bin numbers."""

    @property
    def count(self) -> int:
        """Number of bins."""
        ...

    def label(self, image: Image, window: Window) -> Labels:
        """Bin numbers (h, w) of the pixels in a window; negative: in no bin."""
        ...
