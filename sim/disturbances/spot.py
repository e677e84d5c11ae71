"""The lamp dims, and a spot light from above brightens a part of the table."""

from dataclasses import dataclass

import numpy as np

from sim.ranges import Interval, Place, Share, Time
from sim.settled import Settled
from sim.types import Effect, Spot


@dataclass(frozen=True, slots=True)
class Config(Settled):
    """When, where and how bright."""

    props = ("spot",)
    start: Time = 3.0
    """When the light begins to change [s]."""
    ramp: Interval = 0.5
    """How long it takes, and to come back [s]."""
    duration: Time = 3.0
    """How long it stays [s]."""
    x: Place = 0.0
    """Middle of the spot on the table [m]."""
    y: Place = 0.0
    """Middle of the spot on the table [m]."""
    strength: Share = 0.4
    """Brightness of the spot."""
    lamp: Share = 0.5
    """Factor on the lamp's brightness meanwhile: light that adds up to more than 1 is lost."""

    def at(self, time: float) -> Effect:
        times = np.cumsum([self.start, self.ramp, self.duration, self.ramp])
        share = float(np.interp(time, times, (0.0, 1.0, 1.0, 0.0)))
        if share == 0.0:
            return Effect()
        spot = Spot(self.x, self.y, share * self.strength)
        return Effect(lamp=1.0 - share * (1.0 - self.lamp), spot=spot)
