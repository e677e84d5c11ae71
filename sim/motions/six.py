"""The target is moved above the table in all six degrees of freedom, smoothly, as the seed says."""

from dataclasses import dataclass
from math import pi, radians, sqrt
from typing import Annotated, final

import numpy as np
from annotated_types import Ge, Le

from sim.geometry import exp_so3
from sim.types import Array, Pose

WAVES = 2
"""Sines of which each coordinate is the mean."""
SLOWEST = 0.4
"""Lowest frequency of a sine, over the highest."""
MIDDLE = np.array([0.0, 0.0, 0.3])
WAY = 0.1
RISE = 0.1
TURN_DEG = 30.0
TILT_DEG = 20.0
"""Where the motion begins, level [m], and the farthest from there: along x and y [m], up and down
[m], about the vertical [deg], and from level in any direction [deg]. Chosen by hand on `six_dof`,
so that the target stays in sight of a camera a metre above the table."""


@dataclass(frozen=True, slots=True)
class Config:
    """The speed of the motion."""

    frequency: Annotated[float, Ge(0), Le(100)] = 0.2
    """Highest frequency [Hz]."""

    def build(self, rng: np.random.Generator) -> "Six":
        """Return the motion; its frequencies and directions come from the generator."""
        frequencies = self.frequency * rng.uniform(SLOWEST, 1.0, (WAVES, 6))
        return Six(frequencies, rng.choice((-1.0, 1.0), 6))


@final
class Six:
    """Each coordinate is the mean of sines that begin at zero."""

    def __init__(self, frequencies: Array, senses: Array) -> None:
        self._frequencies = frequencies
        # Two tilts at once, of the same size, are sqrt(2) as large.
        tilt = radians(TILT_DEG) / sqrt(2)
        self._largest = senses * (WAY, WAY, RISE, tilt, tilt, radians(TURN_DEG))

    def at(self, time: float) -> Pose:
        """T_world_target at a time [s]."""
        q = self._largest * np.sin(2 * pi * self._frequencies * time).mean(axis=0)
        turned = exp_so3(np.array([0.0, 0.0, q[5]]))
        return Pose(turned @ exp_so3(np.array([q[3], q[4], 0.0])), MIDDLE + q[:3])
