"""An AprilTag of the family 36h11, with a white margin of one cell.

Olson 2011, "AprilTag: A robust and flexible visual fiducial system" (ICRA).
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Le

from sim.marker import Marker
from sim.models.tag_model import tag_target
from sim.models.target import Target
from sim.ranges import Length


@dataclass(frozen=True, slots=True)
class Config:
    """Settings of the tag: its number and its size."""

    id: Annotated[int, Ge(0), Le(586)] = 0
    """Number of the tag in its family."""
    size: Length = 0.12
    """Side of its black square [m]."""

    @property
    def marker(self) -> Marker:
        """The AprilTag that this target is."""
        return Marker(self.id, self.size)

    def build(self, rng: np.random.Generator) -> Target:
        """Return the target; uses no random numbers."""
        return tag_target(self.marker)
