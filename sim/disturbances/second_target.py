"""Disturbance: a second target, a copy of the first, drives straight across the table."""

from dataclasses import dataclass

from sim.kinds import BuildsItself
from sim.motions import line
from sim.ranges import Place, Time
from sim.types import Effect

HEADING_DEG = 90.0
"""Direction of the drive, from world x towards y [deg]: across the other scenarios' drives."""
SPEED = 0.2
"""Speed [m/s], chosen by hand: twice that of the target on a line."""


@dataclass(frozen=True, slots=True)
class Config(BuildsItself):
    """Settings of the second target: when it appears and for how long [s], and where it starts, x,
    y in the world [m]. It drives along world y at 0.2 m/s.
    """

    props = ("second_target",)
    start: Time = 3.0
    """Time at which it appears [s]."""
    duration: Time = 6.0
    """Time after which it disappears again [s]."""
    x: Place = 0.0
    """Position along world x at which it appears [m]."""
    y: Place = -0.6
    """Position along world y at which it appears [m]."""

    def at(self, time: float) -> Effect:
        since = time - self.start
        if not 0 <= since <= self.duration:
            return Effect()
        return Effect(second=line.Config(self.x, self.y, HEADING_DEG, SPEED).at(since))
