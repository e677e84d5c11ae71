"""Joint colour and texture bins: RGB and the major uniform local binary patterns
(Ning, Zhang, Zhang, Wu 2009; Nagy, Ahmed, Zayed).

A neighbour counts as 1 where it is at least `threshold` brighter than the centre; the pattern is
uniform if it has at most two changes around the circle, and its label is its number of ones (riu2
of Ojala, Pietikainen, Maenpaa 2002, for any number of neighbours and any radius). Uniform patterns
of two to six ones of eight are the texture's five bins; all other pixels (flat, spots, noise) count
as nothing in the papers, and as the setting `rest` says here. The PFJCTH paper's equation 13 says
"otherwise 0": it means discard, not bin 0.
"""

import math
from dataclasses import dataclass
from typing import Annotated, Literal

import cv2
import numpy as np
from annotated_types import Ge, Le
from numpy.typing import NDArray

from sim.ranges import Share
from sim.types import Image
from tracking.appearance.bins import Bins, ColourBins, Window
from tracking.appearance.model import AppearanceSettings
from tracking.loops.point_histograms import Labels
from tracking.settings import MOST_LEVELS
from tracking.types import Region, State, Trait

THRESHOLD = 8.0
"""Least difference of a neighbour that counts as brighter [grey levels]: the a = -8 of the
authors' program."""
FEWEST = 2
"""Least number of ones, and of zeros, in a pattern that counts as texture."""
NO_FRACTION = 1e-9
"""Distance from a pixel's row or column below which a neighbour is on it [px]."""

Rest = Literal["discard", "bin", "colour"]
Grey = NDArray[np.float32]


def riu2(bits: NDArray[np.bool_]) -> NDArray[np.int16]:
    """Return the numbers of ones (...) among the P bits of binary patterns (P, ...), as int16; -1
    for patterns that are not uniform.

    A pattern is uniform if it has at most two changes around its circle of P bits.
    """
    changes = np.sum(bits != np.roll(bits, 1, axis=0), axis=0)
    return np.where(changes <= 2, bits.sum(axis=0), -1).astype(np.int16)


def ones_of(
    grey: Grey, threshold: float = THRESHOLD, neighbours: int = 8, radius: float = 1.0
) -> NDArray[np.int16]:
    """Return the numbers of ones (h - 2m, w - 2m) of the local binary patterns of the pixels that
    are at least m from the border; -1 for patterns that are not uniform (more than two changes
    around the circle). A bit is one where a neighbour is at least `threshold` brighter than the
    pixel.

    Args:
        grey: A picture (h, w) [grey levels].
        threshold: Least difference of a brighter neighbour [grey levels].
        neighbours: Points P on the circle around the pixel, the first to the right, then clockwise.
        radius: Radius of the circle [px]; m is the radius rounded up.
    """
    least = _inner(grey, radius, 0, 0) + np.float32(threshold)
    turns = 2 * np.pi * np.arange(neighbours) / neighbours
    circle = radius * np.column_stack([np.sin(turns), np.cos(turns)])
    around = [_between(grey, radius, dy, dx) for dy, dx in circle.tolist()]
    return riu2(np.stack([neighbour >= least for neighbour in around]))


def _inner(grey: Grey, radius: float, dy: int, dx: int) -> Grey:
    """Return the grey levels (h - 2m, w - 2m) that lie dy rows below and dx columns right of the
    inner pixels: those that are at least m, the radius [px] rounded up, from the border.
    """
    (height, width) = grey.shape
    margin = math.ceil(radius)
    return grey[margin + dy : height - margin + dy, margin + dx : width - margin + dx]


def _between(grey: Grey, radius: float, dy: float, dx: float) -> Grey:
    """Return the grey levels (h - 2m, w - 2m) that lie dy [px] below and dx [px] right of the inner
    pixels, by bilinear interpolation. Inner pixels are at least m, the radius [px] rounded up, from
    the border.
    """
    (near_y, far_y, by_y) = _split(dy)
    (near_x, far_x, by_x) = _split(dx)
    if by_y == 0 and by_x == 0:
        return _inner(grey, radius, near_y, near_x)
    rest_y = np.float32(1 - by_y)
    rest_x = np.float32(1 - by_x)
    by_y = np.float32(by_y)
    by_x = np.float32(by_x)
    below = by_y * rest_x
    beside = rest_y * by_x
    a = _inner(grey, radius, far_y, near_x)
    b = _inner(grey, radius, near_y, far_x)
    # Diagonal neighbours have equal weights: one product, and the same bits in either order.
    sides = below * (a + b) if below == beside else below * a + beside * b
    corner = by_y * by_x * _inner(grey, radius, far_y, far_x)
    mixed = corner + sides + rest_y * rest_x * _inner(grey, radius, near_y, near_x)
    return mixed.astype(np.float32)


def _split(distance: float) -> tuple[int, int, float]:
    """Return the whole numbers of pixels next to a distance [px], towards zero and away from it,
    and the weight of the latter in linear interpolation.
    """
    size = abs(distance)
    whole = math.floor(size + NO_FRACTION)
    share = max(size - whole, 0.0)
    sign = 1 if distance > 0 else -1
    if share < NO_FRACTION:
        return sign * whole, sign * whole, 0.0
    return sign * whole, sign * (whole + 1), share


@dataclass(frozen=True, slots=True)
class TextureBins:
    """Joint bins of colour and texture: one for each of levels^3 colours with each of the major
    uniform local binary patterns, five for eight neighbours of a pixel on a circle of `radius` px.
    All other pixels count in no bin (`rest` = "discard"), in one ("bin"), or in one for each colour
    ("colour").
    """

    levels: int = 8
    """Colour bins a channel; 1: texture alone."""
    neighbours: int = 8
    """Points on the circle."""
    radius: float = 1.0
    """Radius of the circle [px]."""
    rest: Rest = "discard"
    """Bins of pixels without major texture: "discard" none, "bin" one, "colour" one a colour."""

    @property
    def textures(self) -> int:
        """Number of texture bins P - 3 for P = `neighbours`: the uniform patterns with at least two
        ones and two zeros.
        """
        return self.neighbours + 1 - 2 * FEWEST

    @property
    def count(self) -> int:
        major = self.levels**3 * self.textures
        return major + {"discard": 0, "bin": 1, "colour": self.levels**3}[self.rest]

    def label(self, image: Image, window: Window) -> Labels:
        """Return the numbers of the joint bins of colour and texture, as integers (h, w), of the h
        x w pixels in a window of an image, RGB (H, W, 3); -1 for a pixel in no bin.
        """
        colours = ColourBins(self.levels).label(image, window)
        if colours.size == 0:
            return colours
        part = _cut(image, window, math.ceil(self.radius))
        grey = cv2.cvtColor(part, cv2.COLOR_RGB2GRAY).astype(np.float32)
        # Patterns of 0 or 1 ones or zeros are flat areas and spots: they are not major.
        texture = ones_of(grey, THRESHOLD, self.neighbours, self.radius) - FEWEST
        major = (texture >= 0) & (texture < self.textures)
        # Many levels and textures make more bins than 16 bits hold.
        number = np.int16 if self.count <= np.iinfo(np.int16).max else np.int32
        colours = colours.astype(number)
        joint = colours * number(self.textures) + texture
        plain = self.levels**3 * self.textures
        rest = {"discard": -1, "bin": plain, "colour": plain + colours}[self.rest]
        return np.where(major, joint, rest).astype(number)


@dataclass(frozen=True)
class TextureSettings(AppearanceSettings):
    """Settings of histograms over joint bins of colour and texture (uniform local binary patterns):
    colour bins of each channel, number of a pixel's neighbours and radius of their circle [px],
    bins of pixels without texture (`rest`, as for `TextureBins`), and, for `rest` = "discard", the
    share of textured pixels below which colour alone is counted.
    """

    traits = frozenset({Trait.COLOUR, Trait.TEXTURE})

    levels: Annotated[int, Ge(1), Le(MOST_LEVELS)] = 8
    """Colour bins a channel; 1: texture alone."""
    neighbours: Annotated[int, Ge(5), Le(24)] = 8
    """Neighbours P of a pixel on the circle of its pattern; P - 3 textures count."""
    radius: Annotated[float, Ge(1), Le(8)] = 1.0
    """Radius R of that circle [px]; between pixels the image is interpolated bilinearly."""
    rest: Rest = "colour"
    """Pixels without major texture count as nothing ("discard"), as the papers have it, which does
    not see how many of them a box holds; as one bin of all ("bin"); or as a bin for each colour
    ("colour")."""
    least_texture: Share = 0.25
    """With a smaller share of textured pixels in the target, colour alone is counted; with rest =
    "discard" only, which would leave next to nothing."""

    def bins(self, image: Image, region: Region, state: State) -> Bins:
        """Return the joint histogram bins of colour and texture; or bins of colour alone if `rest`
        is "discard", `levels` is above 1, and the share of textured pixels of the target in the
        first picture is below `least_texture`: few pixels in so many bins make a new histogram in
        each picture.

        Args:
            image: First picture, RGB (H, W, 3).
            region: The target's rectangle [px].
            state: State of the target in that picture.
        """
        joint = TextureBins(self.levels, self.neighbours, self.radius, self.rest)
        # The square in the middle: the corners of the region may show the ground.
        inside = Window.around(state.vector[None], min(region.width, region.height) / 2, image)
        textured = np.mean(joint.label(image, inside) >= 0)
        smooth = self.levels > 1 and textured < self.least_texture
        return ColourBins(self.levels) if smooth else joint


def _cut(image: Image, window: Window, margin: int) -> Image:
    """Return the pixels (h, w, 3) of a window and a margin [px] around it; beyond the border of the
    image its last rows and columns repeat.
    """
    height, width = image.shape[:2]
    rows = np.arange(window.top - margin, window.bottom + margin).clip(0, height - 1)
    columns = np.arange(window.left - margin, window.right + margin).clip(0, width - 1)
    return image[rows[:, None], columns]
