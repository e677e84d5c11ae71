"""The target turns on the spot, drives a leg, turns on the spot again, and so on."""

from dataclasses import dataclass
from math import cos, radians, sin
from typing import Annotated

import numpy as np
from annotated_types import Ge, Le

from sim.ranges import LONGEST, Degrees, Place, Speed
from sim.settled import Settled
from sim.types import Pose


@dataclass(frozen=True, slots=True)
class Config(Settled):
    """Turns and legs."""

    x: Place = -0.1
    """Start [m]."""
    y: Place = -0.1
    """Start [m]."""
    heading_deg: Degrees = -90.0
    """Direction of the nose at first, from world x towards y [deg]."""
    turn_deg: Degrees = 90.0
    """Each turn, from world x towards y [deg]."""
    turn_duration: Annotated[float, Ge(0.1), Le(LONGEST)] = 2.0
    """How long a turn lasts [s]."""
    speed: Speed = 0.1
    """Speed on a leg [m/s]."""
    leg_duration: Annotated[float, Ge(0.1), Le(LONGEST)] = 2.0
    """How long a leg lasts [s]."""

    def at(self, time: float) -> Pose:
        rounds, rest = divmod(time, self.turn_duration + self.leg_duration)
        way = complex(self.x, self.y)
        for k in range(int(rounds)):
            way += self.leg_duration * self.speed * self._direction(k + 1)
        turned = min(rest / self.turn_duration, 1.0)
        nose = self._direction(rounds + turned)
        way += max(rest - self.turn_duration, 0.0) * self.speed * nose
        return Pose.planar(way.real, way.imag, float(np.angle(nose)))

    def _direction(self, turns: float) -> complex:
        """The nose's direction after so many turns."""
        angle = radians(self.heading_deg + turns * self.turn_deg)
        return complex(cos(angle), sin(angle))
