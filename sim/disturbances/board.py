"""A board slides between camera and target, stays there, and slides out again."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Le

from sim.ranges import Interval, Place, Time
from sim.settled import Settled
from sim.types import Effect


@dataclass(frozen=True, slots=True)
class Config(Settled):
    """When and how fast."""

    props = ()
    start: Time = 4.0
    """When it stands first [s]."""
    duration: Time = 0.5
    """How long it stands [s]."""
    slide: Interval = 0.2
    """How long the board takes to slide in, and out [s]."""
    distance: Place = 0.6
    """Where it comes from and goes to: sideways distance from the line of sight [m]."""
    offset: Annotated[float, Ge(0), Le(5)] = 0.0
    """Where it stops: sideways from the line of sight [m]. Other than at 0 it goes back where
    it came from; from 0.12 to 0.26 it hides a part of the target only."""

    def at(self, time: float) -> Effect:
        # Fully hidden means within the board's own rim, which its slide has passed a moment before
        # it stops.
        ends = self.start + self.duration
        times = (self.start - self.slide, self.start, ends, ends + self.slide)
        if not times[0] <= time <= times[-1]:
            return Effect()
        end = self.distance if self.offset == 0 else -self.distance
        places = (-self.distance, -self.offset, -self.offset, end)
        return Effect(board=float(np.interp(time, times, places)))
