"""Motion: the target drives straight on at constant speed."""

from dataclasses import dataclass

from sim.motions._straight import Straight
from sim.ranges import Place, Speed


@dataclass(frozen=True, slots=True)
class Config(Straight):
    """Settings of a straight drive: start x, y in the world [m], direction from world x towards y
    [deg], and speed [m/s].
    """

    x: Place = -0.5
    speed: Speed = 0.1
    """Speed along the line [m/s]; below zero the target drives backwards."""

    def way(self, time: float) -> float:
        return self.speed * time
