"""Motion: the target drives back and forth on a straight line at constant speed, and reverses
instantly (the experiment of Teuliere, Marchand and Eck, section VI).
"""

from dataclasses import dataclass

from sim.motions._straight import Straight
from sim.ranges import Degrees, Length, Speed


@dataclass(frozen=True, slots=True)
class Config(Straight):
    """Settings of a straight line on which the target drives back and forth, from its middle on:
    its middle x, y in the world [m], its direction from world x towards y [deg], its length [m],
    and the speed [m/s].
    """

    heading_deg: Degrees = -90.0
    speed: Speed = 0.1
    """Speed along the line [m/s]."""
    length: Length = 0.5
    """Length of the line [m]; the drive starts in its middle."""

    def way(self, time: float) -> float:
        driven = (self.speed * time + self.length / 2) % (2 * self.length)
        return min(driven, 2 * self.length - driven) - self.length / 2
