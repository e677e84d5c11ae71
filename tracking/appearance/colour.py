"""Colour bins: an RGB picture as a picture of bin numbers."""

from __future__ import annotations

from dataclasses import dataclass

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
    def around(states: Array, radius: float, image: Image) -> Window:
        """The part of the image within a radius (at scale 1) of any of the states (N, 4)."""
        reach = radius * np.exp(states[:, 3])
        height, width = image.shape[:2]
        left = np.clip(np.floor(np.min(states[:, 0] - reach)), 0, width)
        right = np.clip(np.ceil(np.max(states[:, 0] + reach)), 0, width)
        top = np.clip(np.floor(np.min(states[:, 1] - reach)), 0, height)
        bottom = np.clip(np.ceil(np.max(states[:, 1] + reach)), 0, height)
        return Window(int(left), int(top), int(right), int(bottom))


@dataclass(frozen=True, slots=True)
class ColourBins:
    """Equal bins in each channel of RGB."""

    levels: int = 8
    """Bins a channel: a power of two."""

    def __post_init__(self) -> None:
        if self.levels not in (2, 4, 8, 16, 32):
            raise ValueError(f"levels must be 2, 4, 8, 16 or 32, not {self.levels}")

    @property
    def count(self) -> int:
        """Number of bins."""
        return self.levels**3

    def label(self, image: Image, window: Window) -> Labels:
        """Bin numbers (h, w) of the pixels in a window."""
        bits = self.levels.bit_length() - 1
        channels = (
            image[window.top : window.bottom, window.left : window.right] >> (8 - bits)
        ).astype(np.int16)
        red, green, blue = np.moveaxis(channels, -1, 0)
        return (red << 2 * bits) | (green << bits) | blue
