"""Motion: the target turns on the spot, drives straight on, turns on the spot again, and so on."""

from dataclasses import dataclass
from math import cos, radians, sin

import numpy as np

from sim.kinds import BuildsItself
from sim.ranges import Degrees, Place, Speed
from sim.types import Pose

# Chosen by hand: with the default settings a turn is a quarter turn, and a leg has 0.2 m.
TURN_DURATION = 2.0
"""Duration of a turn on the spot [s]."""
LEG_DURATION = 2.0
"""Duration of a straight leg [s]."""


@dataclass(frozen=True, slots=True)
class Config(BuildsItself):
    """Settings of turns on the spot and straight drives between them, 2 s each: start x, y in the
    world [m], direction of the nose at first and angle of each turn, both from world x towards y
    [deg], and speed of the drives [m/s].
    """

    x: Place = -0.1
    """Start position along world x [m]."""
    y: Place = -0.1
    """Start position along world y [m]."""
    heading_deg: Degrees = -90.0
    """Direction of the nose at first, from world x towards y [deg]."""
    turn_deg: Degrees = 90.0
    """Angle of each turn, from world x towards y [deg]."""
    speed: Speed = 0.1
    """Speed on a leg [m/s]."""

    def at(self, time: float) -> Pose:
        rounds, rest = divmod(time, TURN_DURATION + LEG_DURATION)
        way = complex(self.x, self.y)
        leg = LEG_DURATION * self.speed
        for k in range(int(rounds)):
            way += leg * self._direction(k + 1)
        for k in range(int(rounds), 0):  # before the start it came along the last legs
            way -= leg * self._direction(k + 1)
        turned = min(rest / TURN_DURATION, 1.0)
        nose = self._direction(rounds + turned)
        way += max(rest - TURN_DURATION, 0.0) * self.speed * nose
        return Pose.planar(way.real, way.imag, float(np.angle(nose)))

    def _direction(self, turns: float) -> complex:
        """Return the direction of the nose after a number of turns on the spot, as a complex number
        of length 1 (x + i y).
        """
        angle = radians(self.heading_deg + turns * self.turn_deg)
        return complex(cos(angle), sin(angle))
