"""The target drives straight on at constant speed."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, radians, sin
from typing import final

import numpy as np

from sim.ranges import Degrees, Place, Speed
from sim.types import Pose


@dataclass(frozen=True, slots=True)
class Config:
    """Where it starts and how fast it goes."""

    x: Place = -0.5
    """Start [m]."""
    y: Place = 0.0
    """Start [m]."""
    heading_deg: Degrees = 0.0
    """Direction of the drive, from world x towards y [deg]."""
    speed: Speed = 0.1
    """Speed [m/s]."""

    def build(self, rng: np.random.Generator) -> Line:
        """The motion; draws nothing."""
        return Line(self)


@final
class Line:
    """A straight drive."""

    def __init__(self, config: Config) -> None:
        self._config = config

    def at(self, time: float) -> Pose:
        """T_world_target at a time [s]."""
        c = self._config
        heading, way = radians(c.heading_deg), c.speed * time
        return Pose.planar(c.x + way * cos(heading), c.y + way * sin(heading), heading)
