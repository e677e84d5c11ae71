"""The target swings along a straight line, its position a sine of time."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, pi, radians, sin
from typing import Annotated, final

import numpy as np
from annotated_types import Ge, Le

from sim.ranges import Degrees, Place
from sim.types import Pose


@dataclass(frozen=True, slots=True)
class Config:
    """The line and the swing."""

    x: Place = 0.0
    """Middle [m]."""
    y: Place = 0.0
    """Middle [m]."""
    heading_deg: Degrees = 0.0
    """Direction of the nose and of the swing, from world x towards y [deg]."""
    amplitude: Place = 0.15
    """Amplitude [m]."""
    frequency: Annotated[float, Ge(0.001), Le(100)] = 0.2
    """Frequency [Hz]."""

    def build(self, rng: np.random.Generator) -> Sine:
        """The motion; draws nothing."""
        return Sine(self)


@final
class Sine:
    """A harmonic swing along the heading; the nose never turns."""

    def __init__(self, config: Config) -> None:
        self._config = config

    def at(self, time: float) -> Pose:
        """T_world_target at a time [s]."""
        c = self._config
        way = c.amplitude * sin(2 * pi * c.frequency * time)
        heading = radians(c.heading_deg)
        return Pose.planar(c.x + way * cos(heading), c.y + way * sin(heading), heading)
