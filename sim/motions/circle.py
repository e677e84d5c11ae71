"""The target drives around a circle, its nose along the tangent."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, pi, sin
from typing import Annotated, final

import numpy as np
from annotated_types import Ge, Le

from sim.ranges import Length, Place
from sim.types import Pose


@dataclass(frozen=True, slots=True)
class Config:
    """The circle."""

    x: Place = 0.0
    """Centre [m]."""
    y: Place = 0.0
    """Centre [m]."""
    radius: Length = 0.15
    """Radius [m]."""
    frequency: Annotated[float, Ge(-100), Le(100)] = 0.15
    """Rounds a second [Hz]; negative drives clockwise as seen from above."""

    def build(self, rng: np.random.Generator) -> Circle:
        """The motion; draws nothing."""
        return Circle(self)


@final
class Circle:
    """A round drive at constant speed."""

    def __init__(self, config: Config) -> None:
        self._config = config

    def at(self, time: float) -> Pose:
        """T_world_target at a time [s]."""
        c = self._config
        angle = 2 * pi * c.frequency * time
        nose = angle + (pi / 2 if c.frequency >= 0 else -pi / 2)
        return Pose.planar(c.x + c.radius * cos(angle), c.y + c.radius * sin(angle), nose)
