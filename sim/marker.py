"""Targets that are AprilTags: a tracker of tags finds their corners without a template."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from sim.outline import Outline
from sim.types import Array

SAME_SIZE = 0.01
"""Sides that differ by less than this share of them are the same."""


@dataclass(frozen=True, slots=True)
class Marker:
    """An AprilTag of the family 36h11."""

    id: int
    """Number in the family, 0..586."""
    size: float
    """Side of its black square [m]."""

    def is_outline(self, outline: Array) -> bool:
        """Return whether a reference rectangle with the corners (4, 3) [m] is as large as the tag's
        black square, within 1 %.
        """
        sides = Outline(outline)
        return np.allclose([sides.length, sides.width], self.size, rtol=SAME_SIZE)


@runtime_checkable
class Marked(Protocol):
    """Settings of a target that is an AprilTag."""

    @property
    def marker(self) -> Marker:
        """The AprilTag that the target is."""
        ...


def marker_of(config: object) -> Marker | None:
    """Return the AprilTag that a target with these settings is; None for other targets."""
    return config.marker if isinstance(config, Marked) else None
