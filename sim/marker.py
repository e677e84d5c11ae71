"""A tag that is the whole target: trackers of tags find its outline by themselves."""

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
        """Return whether a reference rectangle (4, 3) [m] has the size of the black square."""
        sides = Outline(outline)
        return np.allclose([sides.length, sides.width], self.size, rtol=SAME_SIZE)


@runtime_checkable
class Marked(Protocol):
    """Settings of a target that is a marker."""

    @property
    def marker(self) -> Marker:
        """The AprilTag that the target is."""
        ...


def marker_of(config: object) -> Marker | None:
    """Return the marker that a target with these settings is; None for other targets."""
    return config.marker if isinstance(config, Marked) else None
