"""Disturbance: the lamp dims, and a spot light from above brightens a part of the table."""

from dataclasses import dataclass

import numpy as np

from sim.kinds import BuildsItself
from sim.ranges import Interval, Place, Time
from sim.types import Effect, Spot

STRENGTH = 0.4
LAMP = 0.5
"""Brightness of the spot at full strength, and the factor on the lamp's brightness meanwhile: light
that adds up to more than 1 is lost."""


@dataclass(frozen=True, slots=True)
class Config(BuildsItself):
    """Settings of the spot light: when the light begins to change, how long the spot stays at full
    strength, how long each change (`ramp`) takes [s], and the spot's position on the table's x axis
    [m].
    """

    props = ("spot",)
    start: Time = 3.0
    """Time at which the light begins to change [s]."""
    ramp: Interval = 0.5
    """Duration of the change, and of the change back [s]."""
    duration: Time = 3.0
    """Time between the two changes [s]."""
    x: Place = 0.0
    """Middle of the spot along the table's x [m]; it lies on y = 0."""

    def at(self, time: float) -> Effect:
        times = np.cumsum([self.start, self.ramp, self.duration, self.ramp])
        share = float(np.interp(time, times, (0.0, 1.0, 1.0, 0.0)))
        if share == 0.0:
            return Effect()
        return Effect(lamp=1.0 - share * (1.0 - LAMP), spot=Spot(self.x, 0.0, share * STRENGTH))
