"""Camouflage: a car painted in its ground's own colours, which only the texture of its paint shows.

For the claim of the PFJCTH paper that colour and texture together follow what neither does alone.
Ground and car have the same mean colour and the same spread, the ground in coarse blotches, the
car in fine ones. Gravel in another colour, with the car's texture, lies on the ground. Motion,
sizes and noise are those of `texture`.
"""

from dataclasses import dataclass
from typing import Annotated

import cv2
import numpy as np
from annotated_types import Ge, Le

from sim.types import Image
from tracking.evaluation.sequences.generators import texture
from tracking.evaluation.sequences.generators._painting import blotches
from tracking.evaluation.sequences.generators.texture import HEIGHT, SIZE, WIDTH

COARSE, FINE, SPREAD = 6.0, 1.2, 20.0
"""Size of the blotches of ground and paint [px], and their spread [grey levels]."""
OTHER = 70.0
"""How far the gravel's colour is from the car's (Euclidean, RGB)."""


@dataclass(frozen=True, slots=True)
class Config(texture.Config):
    """Texture's settings, and the gravel."""

    gravel: Annotated[int, Ge(0), Le(1000)] = 15
    """Number of patches of gravel, each about as large as the car."""

    def _paint(self, rng: np.random.Generator) -> tuple[Image, Image]:
        colour = rng.uniform(90, 160, 3)
        away = rng.normal(0, 1, 3)
        other = colour + OTHER * away / np.linalg.norm(away)
        ground = blotches(rng, WIDTH, HEIGHT, COARSE, colour, SPREAD)
        fine = blotches(rng, WIDTH, HEIGHT, FINE, other, SPREAD)
        place = np.zeros((HEIGHT, WIDTH), np.uint8)
        for _ in range(self.gravel):
            centre = rng.integers((0, 0), (WIDTH, HEIGHT)).tolist()
            half, turn = (SIZE[0] // 2, SIZE[1] // 2), float(rng.uniform(0, 180))
            cv2.ellipse(place, centre, half, turn, 0, 360, (1,), -1)
        ground[place > 0] = fine[place > 0]
        return ground, blotches(rng, *SIZE, FINE, colour, SPREAD)
