"""Bins of a histogram: numbers of the pixels in a window of the image."""

import math
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from sim.types import Array, Image
from tracking.loops import colour_labels as loops
from tracking.types import check_picture

Labels = NDArray[np.integer[Any]]
DARK = 8
"""Added to the largest channel of evenly lit pixels: darker ones are noise without colour."""


@dataclass(frozen=True, slots=True)
class Window:
    """A rectangle of whole pixels inside an image."""

    left: int
    top: int
    right: int
    bottom: int

    @staticmethod
    def around(states: Array, radius: float, image: Image, more: float = 0.0) -> "Window":
        """Return the part of an image that holds all within a radius of states.

        Args:
            states: States (N, 4).
            radius: Radius of the template at scale 1 [px].
            image: Image whose size bounds the window.
            more: Distance by which the window goes farther [px].
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

    def holds(self, other: "Window") -> bool:
        """Return whether the other window lies inside."""
        return (
            self.left <= other.left
            and self.top <= other.top
            and self.right >= other.right
            and self.bottom >= other.bottom
        )


def _whole(at: int, most: int) -> int:
    return min(max(at, 0), most)


class Bins(Protocol):
    """Bins that pixels are counted in."""

    @property
    def count(self) -> int:
        """Number of bins."""
        ...

    def label(self, image: Image, window: Window) -> Labels:
        """Return bin numbers (h, w) of the pixels in a window; negative: in no bin."""
        ...


@dataclass(frozen=True, slots=True)
class ColourBins:
    """Equal bins in each channel of RGB."""

    levels: int = 8
    """Bins a channel, 1 to `MOST_LEVELS`."""

    @property
    def count(self) -> int:
        return self.levels**3

    def label(self, image: Image, window: Window) -> Labels:
        at = (window.left, window.top, window.right, window.bottom)
        return loops.labels(image, *at, self.levels)


class LabelledImage:
    """One picture with the bin numbers of its pixels, each computed once and only where needed.

    The labels live as long as this object. A caller may write the next picture into the same
    array, as cameras do: the next picture is another object.
    """

    def __init__(
        self, image: Image, bins: Bins, farthest: float = 0.0, blurred: Image | None = None
    ) -> None:
        """Label nothing yet.

        Args:
            image: RGB (H, W, 3); not written to while this object is in use.
            bins: Bins of the pixels.
            farthest: Label at least this far around any state [px].
            blurred: The picture as views are read in it; by default the picture itself.
        """
        self.image = image
        self.bins = bins
        self.blurred = image if blurred is None else blurred
        self._farthest = farthest
        self._last: tuple[Window, Labels] | None = None

    def around(self, states: Array, radius: float, more: float = 0.0) -> tuple[Labels, int, int]:
        """Return the labels (h, w) around states, and the first column and row they stand for.

        Args:
            states: States (N, 4).
            radius: Distance around them, at scale 1 [px].
            more: Distance beyond that, at any scale [px].
        """
        last = self._last
        if last is None or not last[0].holds(Window.around(states, radius, self.image, more)):
            window = Window.around(states, max(radius, self._farthest), self.image, more)
            last = self._last = window, self.bins.label(self.image, window)
        held, labels = last
        return labels, held.left, held.top


def as_seen(image: Image, *, even: bool) -> Image:
    """Return a picture (H, W, 3) as a tracker sees it: as it is, or evenly lit.

    Raises:
        ValueError: It is no picture.
    """
    check_picture(image)
    return loops.evened(image, DARK) if even else image
