"""Colour bins: an RGB picture as a picture of bin numbers."""

from __future__ import annotations

from dataclasses import dataclass

from sim.types import Image
from tracking.appearance.bins import Labels, Window
from tracking.hot import colour_labels as hot


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
        return hot.labels(image, window.left, window.top, window.right, window.bottom, bits)
