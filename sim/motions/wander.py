"""Motion: the target drives around a smooth closed loop, whose shape, start and sense are drawn
from the seed.
"""

from dataclasses import dataclass
from math import atan2, cos, pi, sin
from typing import Annotated, final

import numpy as np
from annotated_types import Ge, Le

from sim.ranges import Length
from sim.types import Array, Pose

HARMONICS = (2, 3)
"""Which waves bend the loop's radius; higher ones would make turns too tight for a car."""
UNEVENNESS = 0.3
"""Sum of the amplitudes of the radius's waves, times their order squared, over the radius; chosen
by hand."""


@dataclass(frozen=True, slots=True)
class Config:
    """Settings of the closed path: its mean radius [m] and the duration of one round [s]."""

    radius: Length = 0.18
    """Mean radius of the loop [m]."""
    period: Annotated[float, Ge(0.01), Le(1e6)] = 9.0
    """Duration of one round [s]."""

    def build(self, rng: np.random.Generator) -> "Wander":
        """Return the motion, whose path, start and sense of rotation are drawn from `rng`."""
        order = np.array(HARMONICS)
        size = UNEVENNESS * rng.dirichlet(np.ones(len(order))) / order**2
        return Wander(self, size, rng.uniform(0, 2 * pi, len(order) + 1), rng.choice((-1, 1)))


@final
class Wander:
    """Motion along a closed path r(phi) = radius (1 + sum a_k cos(k phi + p_k)) around the middle
    of the table, with constant d phi/dt; k = 2, 3. `size` holds the a_k, `phases` the first phi and
    the p_k [rad], and `sense` is 1 (counter-clockwise from above) or -1.
    """

    def __init__(self, config: Config, size: Array, phases: Array, sense: int) -> None:
        self._config = config
        self._sense = sense
        self._waves = list(zip(HARMONICS, size.tolist(), phases[1:].tolist(), strict=True))
        self._begin = float(phases[0])

    def at(self, time: float) -> Pose:
        c = self._config
        phi = self._begin + self._sense * 2 * pi * time / c.period
        r = c.radius * (1 + sum(a * cos(k * phi + p) for k, a, p in self._waves))
        dr = -c.radius * sum(a * k * sin(k * phi + p) for k, a, p in self._waves)
        dx = self._sense * (dr * cos(phi) - r * sin(phi))
        dy = self._sense * (dr * sin(phi) + r * cos(phi))
        return Pose.planar(r * cos(phi), r * sin(phi), atan2(dy, dx))
