"""Motion of a target at rest: the target stands still."""

from dataclasses import dataclass

from sim.motions._straight import Straight


@dataclass(frozen=True, slots=True)
class Config(Straight):
    """Settings of a target at rest: position x, y in the world [m], and direction of its nose from
    world x towards y [deg].
    """

    def way(self, time: float) -> float:
        return 0.0
