"""The target drives straight on, stops, and drives on: its speed jumps."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, radians, sin
from typing import Annotated, final

import numpy as np
from annotated_types import Ge, Le

from sim.ranges import LONGEST, Degrees, Place, Speed, Time
from sim.types import Pose


@dataclass(frozen=True, slots=True)
class Config:
    """The line, the speed, and the times."""

    x: Place = -0.5
    """Start [m]."""
    y: Place = 0.0
    """Start [m]."""
    heading_deg: Degrees = 0.0
    """Direction of the drive, from world x towards y [deg]."""
    speed: Speed = 0.12
    """Speed while it drives [m/s]."""
    go: Annotated[float, Ge(0.1), Le(LONGEST)] = 2.0
    """How long it drives [s]."""
    stop: Time = 1.5
    """How long it then stands [s]."""

    def build(self, rng: np.random.Generator) -> StopAndGo:
        """The motion; draws nothing."""
        return StopAndGo(self)


@final
class StopAndGo:
    """A straight drive with pauses."""

    def __init__(self, config: Config) -> None:
        self._config = config

    def at(self, time: float) -> Pose:
        """T_world_target at a time [s]."""
        c = self._config
        rounds, rest = divmod(time, c.go + c.stop)
        way = c.speed * (rounds * c.go + min(rest, c.go))
        heading = radians(c.heading_deg)
        return Pose.planar(c.x + way * cos(heading), c.y + way * sin(heading), heading)
