"""Targets that are AprilTags, whose corners a tracker can find without a template image."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Le

from sim.outline import Outline
from sim.ranges import Length
from sim.types import Array

SAME_SIZE = 0.01
"""Sides that differ by less than this share of them are the same."""


@dataclass(frozen=True, slots=True)
class Marker:
    """An AprilTag of the family 36h11: its number `id`, and the side `size` of its black square
    [m]. The settings of a target that is such a tag are a subclass.
    """

    id: Annotated[int, Ge(0), Le(586)] = 0
    """Number of the tag in its family."""
    size: Length = 0.12
    """Side of its black square [m]."""

    def is_outline(self, outline: Array) -> bool:
        """Return True if both sides of a reference rectangle with the corners (4, 3) [m] equal the
        side of this tag's black square within 1 %.
        """
        sides = Outline(outline)
        return np.allclose([sides.length, sides.width], self.size, rtol=SAME_SIZE)


def marker_of(config: object) -> Marker | None:
    """Return the settings of a target as a `Marker` if the target is an AprilTag; None for any
    other target.
    """
    return config if isinstance(config, Marker) else None
