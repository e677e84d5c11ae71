"""What a histogram counts: bin numbers of the pixels in a window of the image."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from sim.types import Array, Image
from tracking.hot import colour_labels as hot

Labels = NDArray[np.integer[Any]]
MOST_LEVELS = 32
"""Colour bins a channel whose joint numbers have 16 bits."""


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
        low = np.minimum.reduce(states).tolist()
        high = np.maximum.reduce(states).tolist()
        reach = radius * math.exp(high[3]) + more
        return Window(
            _whole(math.floor(low[0] - reach), width),
            _whole(math.floor(low[1] - reach), height),
            _whole(math.ceil(high[0] + reach), width),
            _whole(math.ceil(high[1] + reach), height),
        )

    def holds(self, other: Window) -> bool:
        """Whether the other one lies inside."""
        return (
            self.left <= other.left
            and self.top <= other.top
            and self.right >= other.right
            and self.bottom >= other.bottom
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


@dataclass(frozen=True, slots=True)
class ColourBins:
    """Equal bins in each channel of RGB."""

    levels: int = 8
    """Bins a channel, 1 to 32."""

    def __post_init__(self) -> None:
        if not 1 <= self.levels <= MOST_LEVELS:
            raise ValueError(f"levels must be 1 to {MOST_LEVELS}, not {self.levels}")

    @property
    def count(self) -> int:
        return self.levels**3

    def label(self, image: Image, window: Window) -> Labels:
        at = (window.left, window.top, window.right, window.bottom)
        return hot.labels(image, *at, self.levels)


class Labelled:
    """One picture with the bin numbers of its pixels, each computed once and only where needed.

    The labels live as long as this object. A caller may write the next picture into the same
    array, as cameras do: the next picture is another object.
    """

    def __init__(self, image: Image, bins: Bins, farthest: float = 0.0) -> None:
        """Label nothing yet.

        Args:
            image: RGB (H, W, 3); not written to while this object is in use.
            bins: What is counted.
            farthest: Label at least this far around any state [px].
        """
        self.bins = bins
        self.blurred = image
        """The picture as views are read in it."""
        self._image = image
        self._farthest = farthest
        self._last: tuple[Window, Labels] | None = None

    def around(self, states: Array, radius: float, more: float = 0.0) -> tuple[Labels, int, int]:
        """Labels (h, w), and the first column and row they stand for.

        Args:
            states: Around which (N, 4).
            radius: How far, at scale 1 [px].
            more: How much farther [px].
        """
        last = self._last
        if last is None or not last[0].holds(Window.around(states, radius, self._image, more)):
            reach = max(radius, self._farthest)
            window = Window.around(states, reach, self._image, more)
            last = self._last = window, self.bins.label(self._image, window)
        held, labels = last
        return labels, held.left, held.top
