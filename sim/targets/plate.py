"""Target: a flat picture on the table, its right side at the target's nose."""

from dataclasses import dataclass

import numpy as np

from sim.files.picture_name import picture_named
from sim.models.paint import THIN, box
from sim.models.target import Target, rectangle
from sim.ranges import File, Length


@dataclass(frozen=True, slots=True)
class Config:
    """Settings of a flat picture on the table: the picture, its length and its width [m]."""

    picture: File = "pebbles"
    """A shipped picture's name, a file, or "skimage:NAME"; it is stretched over the plate."""
    length: Length = 0.2
    """Length along the nose, which is the picture's width [m]."""
    width: Length = 0.15
    """Width, which is the picture's height [m]."""

    def build(self, rng: np.random.Generator) -> Target:
        """Return the target: a plate with the picture, and its upper side as the reference
        rectangle that stands for it in control. `rng` is not used.

        Raises:
            ValueError: The picture is missing or cannot be read.
        """
        picture = picture_named(self.picture, "targets", "picture")
        spec = box((self.length, self.width, THIN), (1, 1, 1, 1), picture)
        return Target(spec, rectangle(np.array([0, 0, THIN]), self.length, self.width))
