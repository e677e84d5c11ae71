"""Motion: the target drives straight on, stops, and drives on: its speed jumps."""

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Le

from sim.motions._straight import Straight
from sim.ranges import LONGEST, Place, Speed, Time


@dataclass(frozen=True, slots=True)
class Config(Straight):
    """Settings of a straight drive with stops: start x, y in the world [m], direction from world x
    towards y [deg], speed [m/s], and durations of driving (`go`) and standing (`stop`) [s].
    """

    x: Place = -0.5
    speed: Speed = 0.12
    """Speed of a drive [m/s]."""
    go: Annotated[float, Ge(0.1), Le(LONGEST)] = 2.0
    """Duration of a drive [s]."""
    stop: Time = 1.5
    """Duration of the stop after a drive [s]."""

    def way(self, time: float) -> float:
        rounds, rest = divmod(time, self.go + self.stop)
        return self.speed * (rounds * self.go + min(rest, self.go))
