"""Camouflage: a car painted in its ground's own colours, which only the texture of its paint shows.

For the claim of the PFJCTH paper that colour and texture together follow what neither does alone.
The ground is a mosaic of four colours in coarse patches, the car a fine mosaic of the same four in
the same shares: its colour histogram is that of any place. Gravel, a fine mosaic of two of the four
colours, lies on the ground: its texture is the car's. Motion, sizes and noise are those of
`texture`.
"""

from dataclasses import dataclass
from typing import Annotated

import cv2
import numpy as np
from annotated_types import Ge, Le

from sim.types import Array, Image
from tracking.evaluation.sequences.generators import texture
from tracking.evaluation.sequences.generators.texture import HEIGHT, SIZE, WIDTH

COLOURS = 4
LEAST_APART = 60.0
"""Least difference between two of the colours (Euclidean, RGB)."""
COARSE, FINE = 4.0, 1.3
"""Size of the patches of ground and paint [px]."""
OVER = 4
"""The paint's resolution, over the picture's: its colours do not mix when it is pasted."""


@dataclass(frozen=True, slots=True)
class Config(texture.Config):
    """Texture's settings, and the gravel."""

    gravel: Annotated[int, Ge(0), Le(1000)] = 20
    """Number of patches of gravel, each about as large as the car."""

    def _paint(self, rng: np.random.Generator) -> tuple[Image, Image]:
        colours = _apart(rng)
        ground = _mosaic(rng, colours, WIDTH, HEIGHT, COARSE)
        for _ in range(self.gravel):
            two = colours[rng.permutation(COLOURS)[:2]]
            fine = _mosaic(rng, two, WIDTH, HEIGHT, FINE)
            place = np.zeros((HEIGHT, WIDTH), np.uint8)
            centre = rng.integers((0, 0), (WIDTH, HEIGHT)).tolist()
            half, turn = (SIZE[0] // 2, SIZE[1] // 2), float(rng.uniform(0, 180))
            cv2.ellipse(place, centre, half, turn, 0, 360, (1,), -1)
            ground[place > 0] = fine[place > 0]
        return ground, _mosaic(rng, colours, OVER * SIZE[0], OVER * SIZE[1], OVER * FINE)


def _apart(rng: np.random.Generator) -> Array:
    """Random colours (4, 3) that differ clearly."""
    while True:
        colours = rng.uniform(50, 205, (COLOURS, 3))
        far = np.linalg.norm(colours[:, None] - colours, axis=2) + 1e3 * np.eye(COLOURS)
        if far.min() > LEAST_APART:
            return colours


def _mosaic(
    rng: np.random.Generator, colours: Array, width: int, height: int, grain: float
) -> Image:
    """Patches (height, width, 3) of colours in equal shares, of a size [px]."""
    fields = [cv2.GaussianBlur(rng.normal(0, 1, (height, width)), (0, 0), grain) for _ in colours]
    scaled = np.stack([field / field.std() for field in fields])
    return colours[np.argmax(scaled, axis=0)].round().astype(np.uint8)
