"""Target: an AprilTag of the family 36h11, with a white margin of one cell of its pattern.

Olson 2011, "AprilTag: A robust and flexible visual fiducial system" (ICRA).
"""

from dataclasses import dataclass

import numpy as np

from sim.marker import Marker
from sim.models.tag_model import tag_target
from sim.models.target import Target


@dataclass(frozen=True, slots=True)
class Config(Marker):
    """Settings of the tag: its number, and the side of its black square [m]."""

    def build(self, rng: np.random.Generator) -> Target:
        """Return the target: a plate with the AprilTag, and the tag's black square as the reference
        rectangle that stands for it in control. `rng` is not used.
        """
        return tag_target(self)
