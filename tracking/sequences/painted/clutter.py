"""Painted sequence: clutter, in which a disc of four colours jumps over a background of similar
discs (Naeem, Pridmore, Mills, artificial sequences, levels a to d; levels e to h are ours, and
harder).

320x240 px, 140 frames, white background. The target, radius 14 px, has four sectors of different
colours. It follows a smooth path (a sum of two sines in each axis) plus Gaussian noise in every
frame, and stays inside the picture. On levels a to h, the standard deviation of the noise on each
axis is 4, 8, 12, 14, 4, 8, 10, 12 px, and the background has 100, 300, 500, 600, 300, 300, 400, 500
discs of radius 7 to 14 px. Each disc has two (e to h: three) of the target's colours, or all four
with `share_all`; other colours are random, and so is their order. The target covers the discs.

On levels a to d four of six trackers with the paper's settings complete nearly all sequences. On e
to h the median of the six trackers (`kams` with 50 particles, the other filters with 200) completes
75, 55, 30 and 10 % of ten sequences, and `kams` has a mean error of 3.0, 3.7, 19 and 11 px.
"""

from dataclasses import dataclass
from typing import Annotated, Literal

import cv2
import numpy as np
from annotated_types import Ge, Le

from sim.types import Array, Image
from tracking.sequences.painted._painting import HEIGHT, WIDTH
from tracking.sequences.sequence import Sequence
from tracking.types import Region

LEVELS = {
    "a": (4.0, 100, 2), "b": (8.0, 300, 2), "c": (12.0, 500, 2), "d": (14.0, 600, 2),
    "e": (4.0, 300, 3), "f": (8.0, 300, 3), "g": (10.0, 400, 3), "h": (12.0, 500, 3),
}  # fmt: skip
"""Standard deviation of the position's noise [px], number of discs in the background, and number of
the target's colours that each of them has, by level."""
RADIUS = 14
"""Radius of the target and of the largest disc [px]."""
SMALLEST = 7
"""Radius of the smallest disc [px]."""
SECTORS = 4
SUBPIXEL_BITS = 4
"""Fractional bits of OpenCV's coordinates: discs are drawn to sixteenths of a pixel."""
LEAST_APART = 100.0
"""Least difference between colours of the target (Euclidean, RGB)."""
CYCLES = (0.6, 1.6)
"""Least and largest number of oscillations of the path in a period."""
PERIOD = 139
"""Length of the paper's sequences [frames]."""
SWING = 0.6
"""Share of the free space that the smooth path uses."""


@dataclass(frozen=True, slots=True)
class Config:
    """Settings of a painted sequence with noise and clutter: their level, from a (easiest) to h
    (hardest), the number of pictures, and whether each disc in the background has all colours of
    the target.
    """

    level: Literal["a", "b", "c", "d", "e", "f", "g", "h"] = "a"
    """Level of noise and clutter; e to h are harder than the paper's a to d."""
    frames: Annotated[int, Ge(2), Le(100_000)] = 140
    """Number of pictures."""
    share_all: bool = False
    """The background's discs have all four colours of the target, in another order."""

    def build(self, rng: np.random.Generator) -> Sequence:
        """Return a new sequence of painted pictures with the target's exact states, whose random
        numbers come from `rng`.
        """
        sigma, count, shared = LEVELS[self.level]
        colours = _apart(rng)
        ground = _ground(rng, colours, count, SECTORS if self.share_all else shared)
        centres = _path(rng, self.frames, sigma)

        def paint(index: int) -> Image:
            image = ground.copy()
            _disc(image, centres[index], RADIUS, colours)
            return image

        states = np.column_stack([centres, np.zeros(self.frames), np.ones(self.frames)])
        region = Region(2 * RADIUS, 2 * RADIUS)
        return Sequence.painted(f"clutter-{self.level}", paint, region, states)


def _apart(rng: np.random.Generator) -> Array:
    """Return four random colours, RGB (4, 3), at least `LEAST_APART` from each other and white."""
    while True:
        colours = rng.integers(0, 256, (SECTORS, 3)).astype(float)
        others = np.vstack([colours, [255.0] * 3])
        far = np.linalg.norm(others[:, None] - others, axis=2) + 1e3 * np.eye(SECTORS + 1)
        if far.min() > LEAST_APART:
            return colours


def _ground(rng: np.random.Generator, colours: Array, count: int, kept: int) -> Image:
    """Return a background (HEIGHT, WIDTH, 3) of `count` discs, each with `kept` of the target's
    colours (4, 3).
    """
    image = np.full((HEIGHT, WIDTH, 3), 255, np.uint8)
    for _ in range(count):
        mixed = np.vstack(
            [
                colours[rng.permutation(SECTORS)[:kept]],
                rng.integers(0, 256, (SECTORS - kept, 3)).astype(float),
            ]
        )
        centre = rng.uniform((0, 0), (WIDTH, HEIGHT))
        _disc(image, centre, rng.uniform(SMALLEST, RADIUS), mixed[rng.permutation(SECTORS)])
    return image


def _path(rng: np.random.Generator, frames: int, sigma: float) -> Array:
    """Return the target's centres (n, 2) [px] in n frames, inside the picture; `sigma` is the
    standard deviation of their noise [px].
    """
    room = np.array([WIDTH, HEIGHT]) / 2 - RADIUS
    time = 2 * np.pi * np.arange(frames)[:, None] / PERIOD
    smooth = sum(
        share * np.sin(rng.uniform(*CYCLES, 2) * time + rng.uniform(0, 2 * np.pi, 2))
        for share in (0.7, 0.3)
    )
    thrown = SWING * room * smooth + rng.normal(0, sigma, (frames, 2))
    return thrown.clip(-room, room) + (WIDTH / 2, HEIGHT / 2)


def _disc(image: Image, centre: Array, radius: float, colours: Array) -> None:
    """Paint a disc of equal sectors, one for each colour (n, 3), into an image (H, W, 3); centre
    (2,) and radius are in pixels.
    """
    unit = 1 << SUBPIXEL_BITS
    # In OpenCV a pixel's centre has whole coordinates.
    x, y = np.round((centre - 0.5) * unit).astype(int).tolist()
    axes = (round(radius * unit), round(radius * unit))
    step = 360 / len(colours)
    for i, colour in enumerate(colours.tolist()):
        cv2.ellipse(
            image, (x, y), axes, 0, step * i, step * (i + 1), colour, -1, cv2.LINE_AA, SUBPIXEL_BITS
        )
