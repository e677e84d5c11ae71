"""The target stands still."""

from __future__ import annotations

from dataclasses import dataclass
from math import radians
from typing import final

import numpy as np

from sim.ranges import Degrees, Place
from sim.types import Pose


@dataclass(frozen=True, slots=True)
class Config:
    """Where it stands."""

    x: Place = 0.0
    """Position on the table [m]."""
    y: Place = 0.0
    """Position on the table [m]."""
    heading_deg: Degrees = 0.0
    """Direction of the nose, from world x towards y [deg]."""

    def build(self, rng: np.random.Generator) -> Still:
        """The motion; draws nothing."""
        return Still(Pose.planar(self.x, self.y, radians(self.heading_deg)))


@final
class Still:
    """One pose for all times."""

    def __init__(self, pose: Pose) -> None:
        self._pose = pose

    def at(self, time: float) -> Pose:
        """T_world_target at a time [s]."""
        return self._pose
