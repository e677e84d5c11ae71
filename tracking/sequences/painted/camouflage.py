"""Painted sequence: camouflage, a car in the colours of the ground, which only its finer texture
shows.

It tests the claim of the PFJCTH paper that colour and texture together follow a target that neither
follows alone. Gravel in another colour, with the car's texture, lies on the ground. Motion, sizes
and noise are those of `texture`.
"""

from dataclasses import dataclass
from typing import Annotated, Literal

import cv2
import numpy as np
from annotated_types import Ge, Le

from sim.types import Array, Image
from tracking.sequences.painted import texture
from tracking.sequences.painted._painting import HEIGHT, WIDTH, blotches
from tracking.sequences.painted.texture import SIZE

COARSE = 6.0
"""Size of the ground's blotches for a spread of colours [px]."""
FINE = 1.2
"""Size of the blotches of car and gravel [px]."""
SPREAD = 20.0
"""Standard deviation of the colours of ground, car and gravel for a spread of colours [grey
levels]."""
OTHER = 70.0
"""Distance of the gravel's mean colour from the car's for a spread of colours (Euclidean, RGB)."""
BIN = 32
"""Width of one of 8 colour bins a channel [grey levels]."""
SHADE = 9.0
"""Largest distance of a shade from the middle of its colour bin [grey levels]."""
SMOOTH = 8.0
"""Size of the ground's blotches where all shades are of one colour bin [px]."""


@dataclass(frozen=True, slots=True)
class Config(texture.Config):
    """Settings of a painted sequence in which a car has the colours of the ground: those of the
    painted sequence `texture`, the range of the colours, and the number of patches of gravel.
    """

    colours: Literal["one", "spread"] = "one"
    """Shades of "one" colour bin, of 8 a channel, so that one place has the colours of any other;
    or a "spread" of colours, the same for ground and car, whose histogram varies from place to
    place."""
    gravel: Annotated[int, Ge(0), Le(1000)] = 10
    """Number of patches of gravel, each about as large as the car."""

    def _paint(self, rng: np.random.Generator) -> tuple[Image, Image]:
        """Return pictures of the ground (HEIGHT, WIDTH, 3) and of the car (h, w, 3)."""
        one = self.colours == "one"
        if one:
            colour = BIN * (rng.integers(2, 6, 3).astype(np.float64) + 0.5)
            other = colour + BIN * rng.choice(np.array([-1.0, 1.0]), 3)
            ground = _shades(rng, colour)
            fine = _tones(rng, (WIDTH, HEIGHT), other)
        else:
            colour = rng.uniform(90, 160, 3)
            away = rng.normal(0, 1, 3)
            other = colour + OTHER * away / np.linalg.norm(away)
            ground = blotches(rng, WIDTH, HEIGHT, COARSE, colour, SPREAD)
            fine = blotches(rng, WIDTH, HEIGHT, FINE, other, SPREAD)
        place = np.zeros((HEIGHT, WIDTH), np.uint8)
        for _ in range(self.gravel):
            centre = rng.integers((0, 0), (WIDTH, HEIGHT)).tolist()
            half = (SIZE[0] // 2, SIZE[1] // 2)
            turn = float(rng.uniform(0, 180))
            cv2.ellipse(place, centre, half, turn, 0, 360, (1,), -1)
        ground[place > 0] = fine[place > 0]
        if one:
            return ground, _tones(rng, SIZE, colour)
        return ground, blotches(rng, *SIZE, FINE, colour, SPREAD)


def _tones(rng: np.random.Generator, size: tuple[int, int], colour: Array) -> Image:
    """Return a fine picture (height, width, 3) in two tones of a colour (3,), half of the pixels
    each; `size` is width and height [px].
    """
    noise = _noise(rng, size, FINE)
    tone = np.where(noise > np.median(noise), SHADE, -SHADE)
    return (colour + tone[..., None]).astype(np.uint8)


def _shades(rng: np.random.Generator, colour: Array) -> Image:
    """Return a smooth picture (HEIGHT, WIDTH, 3) of the ground in all shades of a colour (3,)
    between the two tones of the car, each equally often.
    """
    noise = _noise(rng, (WIDTH, HEIGHT), SMOOTH)
    order = noise.ravel().argsort().argsort().reshape(noise.shape)
    shade = np.interp(order, (0, noise.size - 1), (-SHADE, SHADE))
    return (colour + shade[..., None]).astype(np.uint8)


def _noise(rng: np.random.Generator, size: tuple[int, int], grain: float) -> Array:
    """Return noise (height, width) with blotches of a size `grain` [px]."""
    return np.asarray(cv2.GaussianBlur(rng.normal(0, 1, size[::-1]), (0, 0), grain), np.float64)
