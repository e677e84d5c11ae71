"""Motion: the target moves above the table in all six degrees of freedom, smoothly, with
frequencies and directions that are drawn from the seed.
"""

from dataclasses import dataclass
from math import pi, radians, sqrt
from typing import Annotated, final

import numpy as np
from annotated_types import Ge, Le

from sim.geometry import exp_so3
from sim.types import Array, Pose

WAVES = 2
"""Number of sines whose mean gives each coordinate."""
SLOWEST = 0.4
"""Lowest frequency of a sine, over the highest."""
MIDDLE = np.array([0.0, 0.0, 0.3])
"""Start position of the level target [m]. It and the default amplitudes were chosen by hand on
`six_dof`, so that the target stays in sight of a camera a metre above the table."""


@dataclass(frozen=True, slots=True)
class Config:
    """Settings of a smooth motion of the target in six degrees of freedom around a start 0.3 m
    above the middle of the table: highest frequency [Hz]; largest distance from the start along
    world x and y (`way`) and along z (`rise`) [m]; largest rotation about the vertical and largest
    tilt [deg].
    """

    frequency: Annotated[float, Ge(0), Le(100)] = 0.2
    """Highest frequency of a sine [Hz]."""
    way: Annotated[float, Ge(0), Le(5)] = 0.1
    """Largest distance from the start along x, and along y [m]."""
    rise: Annotated[float, Ge(0), Le(0.3)] = 0.1
    """Largest height above, and below, the start [m]."""
    turn_deg: Annotated[float, Ge(0), Le(180)] = 30.0
    """Largest rotation about the vertical [deg]."""
    tilt_deg: Annotated[float, Ge(0), Le(90)] = 20.0
    """Largest tilt from level, in any direction [deg]."""

    def build(self, rng: np.random.Generator) -> "Six":
        """Return the motion, whose frequencies and signs of the amplitudes are drawn from `rng`."""
        frequencies = self.frequency * rng.uniform(SLOWEST, 1.0, (WAVES, 6))
        # Two tilts at once, of the same size, are sqrt(2) as large.
        tilt = radians(self.tilt_deg) / sqrt(2)
        largest = np.array([self.way, self.way, self.rise, tilt, tilt, radians(self.turn_deg)])
        return Six(frequencies, largest * rng.choice((-1.0, 1.0), 6))


@final
@dataclass(frozen=True, slots=True, eq=False)
class Six:
    """A motion of the target above the table: its position x, y, z [m] and its rotations about x,
    y, z [rad], relative to the start 0.3 m above the middle of the table, are each the mean of two
    sines of time, with the amplitudes `largest` (6,) and the frequencies (2, 6) [Hz].
    """

    frequencies: Array
    """Frequencies of the sines (2, 6) [Hz]."""
    largest: Array
    """Amplitudes of x, y, z [m] and of the rotations about x, y, z [rad] (6,)."""

    def at(self, time: float) -> Pose:
        """Return the target's pose T_world_target at a time since the start of the run [s]."""
        q = self.largest * np.sin(2 * pi * self.frequencies * time).mean(axis=0)
        turned = exp_so3(np.array([0.0, 0.0, q[5]]))
        return Pose(turned @ exp_so3(np.array([q[3], q[4], 0.0])), MIDDLE + q[:3])
