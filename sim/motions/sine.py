"""Motion: the target swings along a straight line, its position a sine of time."""

from dataclasses import dataclass
from math import pi, sin
from typing import Annotated

from annotated_types import Ge, Le

from sim.motions._straight import Straight
from sim.ranges import Place


@dataclass(frozen=True, slots=True)
class Config(Straight):
    """Settings of a straight line on which the target oscillates: its middle x, y in the world [m];
    its direction, in which the nose points, from world x towards y [deg]; and the oscillation's
    amplitude [m] and frequency [Hz].
    """

    amplitude: Place = 0.15
    """Amplitude of the oscillation [m]."""
    frequency: Annotated[float, Ge(0.001), Le(100)] = 0.2
    """Frequency of the oscillation [Hz]."""

    def way(self, time: float) -> float:
        return self.amplitude * sin(2 * pi * self.frequency * time)
