"""The target is moved above the table in all six degrees of freedom, smoothly, as the seed says."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, radians, sqrt
from typing import Annotated, final

import numpy as np
from annotated_types import Ge, Le

from sim.geometry import exp_so3
from sim.ranges import Place
from sim.types import Array, Pose

WAVES = 2
"""Sines of which each coordinate is the mean."""
SLOWEST = 0.4
"""Lowest frequency of a sine, over the highest."""


@dataclass(frozen=True, slots=True)
class Config:
    """The middle, where it begins, level, and how far it goes from there."""

    x: Place = 0.0
    """Middle [m]."""
    y: Place = 0.0
    """Middle [m]."""
    height: Annotated[float, Ge(0), Le(5)] = 0.3
    """Middle, above the table [m]."""
    way: Annotated[float, Ge(0), Le(5)] = 0.1
    """Farthest along x, and along y [m]."""
    rise: Annotated[float, Ge(0), Le(5)] = 0.1
    """Farthest up and down [m]."""
    turn_deg: Annotated[float, Ge(0), Le(3600)] = 30.0
    """Farthest about the vertical [deg]."""
    tilt_deg: Annotated[float, Ge(0), Le(60)] = 20.0
    """Farthest from level, in any direction [deg]."""
    frequency: Annotated[float, Ge(0), Le(100)] = 0.2
    """Highest frequency [Hz]."""

    def build(self, rng: np.random.Generator) -> Six:
        """The motion; its frequencies and directions come from the generator.

        Raises:
            ValueError: It would go below the table.
        """
        if self.rise > self.height:
            raise ValueError(
                f"rise = {self.rise:g} m is more than height = {self.height:g} m: the target would "
                "be below the table"
            )
        frequencies = self.frequency * rng.uniform(SLOWEST, 1.0, (WAVES, 6))
        return Six(self, frequencies, rng.choice((-1.0, 1.0), 6))


@final
class Six:
    """Each coordinate is the mean of sines that begin at zero."""

    def __init__(self, config: Config, frequencies: Array, senses: Array) -> None:
        self._frequencies = frequencies
        c = config
        self._middle = np.array([c.x, c.y, c.height])
        # Two tilts at once, of the same size, are sqrt(2) as large.
        tilt = radians(c.tilt_deg) / sqrt(2)
        self._largest = senses * (c.way, c.way, c.rise, tilt, tilt, radians(c.turn_deg))

    def at(self, time: float) -> Pose:
        """T_world_target at a time [s]."""
        q = self._largest * np.sin(2 * pi * self._frequencies * time).mean(axis=0)
        turned = exp_so3(np.array([0.0, 0.0, q[5]]))
        return Pose(turned @ exp_so3(np.array([q[3], q[4], 0.0])), self._middle + q[:3])
