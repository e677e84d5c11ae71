"""Motion: the target drives around a circle, its nose along the tangent."""

from dataclasses import dataclass
from math import cos, pi, sin
from typing import Annotated

from annotated_types import Ge, Le

from sim.kinds import BuildsItself
from sim.ranges import Length, Place
from sim.types import Pose


@dataclass(frozen=True, slots=True)
class Config(BuildsItself):
    """Settings of a target that drives around a circle on the table: centre x, y in the world [m],
    radius [m] and rounds per second [Hz], negative for clockwise as seen from above. The target
    starts at (x + radius, y).
    """

    x: Place = 0.0
    """Centre of the circle along world x [m]."""
    y: Place = 0.0
    """Centre of the circle along world y [m]."""
    radius: Length = 0.15
    """Radius of the circle [m]."""
    frequency: Annotated[float, Ge(-100), Le(100)] = 0.15
    """Rounds per second [Hz]; below zero the target drives clockwise as seen from above."""

    def at(self, time: float) -> Pose:
        angle = 2 * pi * self.frequency * time
        nose = angle + (pi / 2 if self.frequency >= 0 else -pi / 2)
        x = self.x + self.radius * cos(angle)
        y = self.y + self.radius * sin(angle)
        return Pose.planar(x, y, nose)
