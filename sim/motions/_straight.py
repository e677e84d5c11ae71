"""Base class of motions along a straight line, the nose ahead."""

from abc import abstractmethod
from dataclasses import dataclass
from math import cos, radians, sin

from sim.kinds import BuildsItself
from sim.ranges import Degrees, Place
from sim.types import Pose


@dataclass(frozen=True, slots=True)
class Straight(BuildsItself):
    """Base class of motions along a straight line; the direction of the nose never changes."""

    x: Place = 0.0
    """Start position along world x [m]."""
    y: Place = 0.0
    """Start position along world y [m]."""
    heading_deg: Degrees = 0.0
    """Direction of the nose, from world x towards y [deg]."""

    @abstractmethod
    def way(self, time: float) -> float:
        """Return the distance from the start along the direction of the nose [m], at a time of the
        run [s].
        """

    def at(self, time: float) -> Pose:
        heading = radians(self.heading_deg)
        way = self.way(time)
        return Pose.planar(self.x + way * cos(heading), self.y + way * sin(heading), heading)
