"""Joint colour and texture bins: RGB and the major uniform local binary patterns
(Ning, Zhang, Zhang, Wu 2009; Nagy, Ahmed, Zayed).

A neighbour counts as 1 where it is at least `threshold` brighter than the centre; the pattern is
uniform if it has at most two changes around the circle. Uniform patterns of two to six ones are the
texture's five bins; all other pixels (flat, spots, noise) count as nothing. The PFJCTH paper's
equation 13 says "otherwise 0": it means discard, not bin 0.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from sim.types import Image
from tracking.appearance.bins import Bins, ColourBins, Labels, Window
from tracking.types import Region, State

THRESHOLD = 8.0
"""How much brighter a neighbour must be [grey levels]: the a = -8 of the authors' program."""
MAJOR = range(2, 7)
"""Numbers of ones in the patterns that count."""
DIAGONAL = 1 - 0.5**0.5
"""A diagonal neighbour at radius 1 lies this far from the corner pixel, in both directions."""


def ones_of(grey: NDArray[np.float32], threshold: float = THRESHOLD) -> NDArray[np.int16]:
    """Number of ones of the uniform pattern at each inner pixel (h - 2, w - 2); -1: not uniform.

    Args:
        grey: (h, w).
        threshold: How much brighter a neighbour must be.
    """
    height, width = grey.shape

    def at(dy: int, dx: int) -> NDArray[np.float32]:
        return grey[1 + dy : height - 1 + dy, 1 + dx : width - 1 + dx]

    def between(dy: int, dx: int) -> NDArray[np.float32]:
        near, far = np.float32(DIAGONAL), np.float32(1 - DIAGONAL)
        sides = near * far * (at(dy, 0) + at(0, dx))
        mixed = far * far * at(dy, dx) + sides + near * near * at(0, 0)
        return mixed.astype(np.float32)

    around = [
        at(0, 1), between(1, 1), at(1, 0), between(1, -1),
        at(0, -1), between(-1, -1), at(-1, 0), between(-1, 1),
    ]  # fmt: skip
    bits = np.stack([neighbour >= at(0, 0) + np.float32(threshold) for neighbour in around])
    changes = np.sum(bits != np.roll(bits, 1, axis=0), axis=0)
    return np.where(changes <= 2, bits.sum(axis=0), -1).astype(np.int16)


@dataclass(frozen=True, slots=True)
class TextureBins:
    """levels^3 colours times five textures; pixels without major texture are in no bin."""

    levels: int = 8
    """Colour bins a channel: a power of two."""
    threshold: float = THRESHOLD
    """How much brighter a neighbour must be [grey levels]."""

    @property
    def count(self) -> int:
        return self.levels**3 * len(MAJOR)

    def label(self, image: Image, window: Window) -> Labels:
        """Bin numbers (h, w) of the pixels in a window; -1: no major texture."""
        colours = ColourBins(self.levels).label(image, window)
        if colours.size == 0:
            return colours
        grey = cv2.cvtColor(_cut(image, window), cv2.COLOR_RGB2GRAY).astype(np.float32)
        ones = ones_of(grey, self.threshold)
        major = (ones >= MAJOR[0]) & (ones <= MAJOR[-1])
        return np.where(major, colours * len(MAJOR) + ones - MAJOR[0], -1).astype(np.int16)


def texture_or_colour(
    image: Image, region: Region, state: State, joint: TextureBins, least: float
) -> Bins:
    """Joint bins, or colour alone where a smaller share than `least` of the target is textured.

    Few pixels in so many bins make a histogram that no two pictures share.
    """
    inside = Window.around(state.vector[None], min(region.width, region.height) / 2, image)
    textured = np.mean(joint.label(image, inside) >= 0)
    return joint if textured >= least else ColourBins(joint.levels)


def _cut(image: Image, window: Window) -> Image:
    """The window with a pixel around it; at the image's border, its last pixel again."""
    height, width = image.shape[:2]
    rows = np.arange(window.top - 1, window.bottom + 1).clip(0, height - 1)
    columns = np.arange(window.left - 1, window.right + 1).clip(0, width - 1)
    return image[rows[:, None], columns]
