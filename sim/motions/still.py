"""The target stands still."""

from __future__ import annotations

from dataclasses import dataclass
from math import radians
from typing import Annotated, final

import numpy as np
from annotated_types import Ge, Le

from sim.types import Degrees, Pose


@dataclass(frozen=True, slots=True)
class Config:
    """Where it stands."""

    x: Annotated[float, Ge(-5), Le(5)] = 0.0
    """Position on the table [m]."""
    y: Annotated[float, Ge(-5), Le(5)] = 0.0
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
