"""What a histogram counts: bin numbers of the pixels in a window of the image."""

from __future__ import annotations

import math
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
        """A part of the image that holds all within a radius (at scale 1) of the states (N, 4).

        Args:
            states: (N, 4).
            radius: Of the template [px].
            image: Its size bounds the window.
            more: How much farther the window goes [px].
        """
        height, width = image.shape[:2]
        low, high = states.min(axis=0).tolist(), states.max(axis=0).tolist()
        reach = radius * math.exp(high[3]) + more
        return Window(
            _whole(math.floor(low[0] - reach), width),
            _whole(math.floor(low[1] - reach), height),
            _whole(math.ceil(high[0] + reach), width),
            _whole(math.ceil(high[1] + reach), height),
        )


def _whole(at: int, most: int) -> int:
    return min(max(at, 0), most)


class Bins(Protocol):
    """A way to turn pixels into bin numbers."""

    @property
    def count(self) -> int:
        """Number of bins."""
        ...

    def label(self, image: Image, window: Window) -> Labels:
        """Bin numbers (h, w) of the pixels in a window; negative: in no bin."""
        ...
