"""Disturbance: the brightness of the picture changes by a factor for a time, with ramps at both
ends.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Le

from sim.kinds import BuildsItself
from sim.ranges import Interval, Time
from sim.types import Effect


@dataclass(frozen=True, slots=True)
class Config(BuildsItself):
    """Settings of the change of brightness: when it begins [s], the factor, how long the factor
    holds [s], and how long the change to the factor and the change back (`ramp`) each take [s].
    """

    props = ()
    start: Time = 3.0
    """Time at which the brightness begins to change [s]."""
    factor: Annotated[float, Ge(0), Le(100)] = 0.7
    """Factor on the brightness after the ramp."""
    ramp: Interval = 0.5
    """Duration of the ramp to the factor, and of the ramp back [s]."""
    duration: Time = 2.0
    """Time between the ramps [s]."""

    def at(self, time: float) -> Effect:
        times = np.cumsum([self.start, self.ramp, self.duration, self.ramp])
        return Effect(gain=float(np.interp(time, times, (1.0, self.factor, self.factor, 1.0))))
