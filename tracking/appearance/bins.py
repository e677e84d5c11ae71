"""Bins of a histogram of colours, and the bin numbers of the pixels in a window (rectangle) of an
image.
"""

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from sim.types import Array, Image
from tracking.loops import colour_labels as loops
from tracking.loops.point_histograms import Labels
from tracking.types import check_picture

DARK = 8
"""Grey levels added to the largest channel of evenly lit pixels: darker ones have no colour but
noise."""


@dataclass(frozen=True, slots=True)
class Window:
    """Rectangle of pixels of an image: columns left .. right - 1 and rows top .. bottom - 1."""

    left: int
    top: int
    right: int
    bottom: int

    @staticmethod
    def around(states: Array, radius: float, image: Image, more: float = 0.0) -> "Window":
        """Return a window that contains the template in all of several states, cut off at the
        borders of an image; it is empty if all of them are outside.

        Args:
            states: States (N, 4): x, y [px], theta [rad], ln scale.
            radius: Radius of the template at scale 1 [px].
            image: Image (H, W, 3) whose size bounds the window.
            more: Margin around the template [px].
        """
        height, width = image.shape[:2]
        low = np.minimum.reduce(states).tolist()
        high = np.maximum.reduce(states).tolist()
        reach = radius * math.exp(high[3]) + more  # of the largest state, for all
        return Window(
            _whole(math.floor(low[0] - reach), width),
            _whole(math.floor(low[1] - reach), height),
            _whole(math.ceil(high[0] + reach), width),
            _whole(math.ceil(high[1] + reach), height),
        )

    def holds(self, other: "Window") -> bool:
        """Return True if the window `other` lies inside this window; equal windows do."""
        return (
            self.left <= other.left
            and self.top <= other.top
            and self.right >= other.right
            and self.bottom >= other.bottom
        )


def _whole(at: int, most: int) -> int:
    return min(max(at, 0), most)


class Bins(Protocol):
    """Protocol of the bins of a histogram, such as equal intervals of colour; each pixel of a
    picture belongs to one bin or to none.
    """

    @property
    def count(self) -> int:
        """Number of bins."""
        ...

    def label(self, image: Image, window: Window) -> Labels:
        """Return the numbers of the histogram bins, 0 to `count` - 1, of the pixels in a window of
        h x w pixels, as integers (h, w); a negative number for a pixel that belongs to no bin.

        Args:
            image: RGB (H, W, 3).
            window: Columns and rows of the image.
        """
        ...


@dataclass(frozen=True, slots=True)
class ColourBins:
    """Histogram bins of colour: red, green and blue are each divided into `levels` equal intervals
    of 0..255, and a bin is one combination of three intervals (`levels`^3 bins).
    """

    levels: int = 8
    """Bins a channel, 1 to `MOST_LEVELS`."""

    @property
    def count(self) -> int:
        return self.levels**3

    def label(self, image: Image, window: Window) -> Labels:
        at = (window.left, window.top, window.right, window.bottom)
        return loops.labels(image, *at, self.levels)


class LabelledImage:
    """One picture with the histogram bin numbers of its pixels. They are computed when `around`
    asks for a window of the picture, for at least `farthest` px (at scale 1) around the states.

    `blurred` is the picture in which stored small pictures of the target are searched, by default
    the picture itself. Make one object for each picture.
    """

    def __init__(
        self, image: Image, bins: Bins, farthest: float = 0.0, blurred: Image | None = None
    ) -> None:
        """Store a picture and bins; pixels are labelled when they are asked for.

        Args:
            image: RGB (H, W, 3); it must not change while this object is in use.
            bins: Bins of the pixels.
            farthest: Least radius [px], at scale 1, that is labelled around states.
            blurred: The picture in which stored views (small pictures of the target) are searched;
                None: `image`.
        """
        self.image = image
        self.bins = bins
        self.blurred = image if blurred is None else blurred
        self._farthest = farthest
        self._last: tuple[Window, Labels] | None = None

    def around(self, states: Array, radius: float, more: float = 0.0) -> tuple[Labels, int, int]:
        """Return the bin numbers (h, w) of the pixels in a window that contains the surroundings of
        all states, and the window's first column and first row in the image [px]. A window from an
        earlier call is used again if it is large enough.

        Args:
            states: States (N, 4): x, y [px], theta [rad], ln scale.
            radius: Radius around each state, at scale 1 [px].
            more: Margin beyond this radius, the same at any scale [px].
        """
        last = self._last
        # Several readers follow each other in a frame: the widest window serves all of them.
        if last is None or not last[0].holds(Window.around(states, radius, self.image, more)):
            window = Window.around(states, max(radius, self._farthest), self.image, more)
            last = self._last = window, self.bins.label(self.image, window)
        held, labels = last
        return labels, held.left, held.top


def as_seen(image: Image, *, even: bool) -> Image:
    """Return a picture, RGB (H, W, 3), as it is or, with `even`, with the brightness made even:
    each channel of a pixel becomes 255 c / (m + 8), rounded down, where c is its value and m the
    largest of the pixel's three [grey levels].

    Raises:
        ValueError: The array is not an RGB picture of uint8.
    """
    check_picture(image)
    return loops.evened(image, DARK) if even else image
