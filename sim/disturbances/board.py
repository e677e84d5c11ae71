"""Disturbance: a board slides between camera and target, stays there, and slides out again."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Le

from sim.kinds import BuildsItself
from sim.ranges import Time
from sim.types import Effect

SLIDE = 0.2
"""Time in which the board slides in, and out [s]."""
DISTANCE = 0.6
"""Sideways distance from the line of sight at which the board is out of the picture [m]. With both
numbers, chosen by hand, the target is hidden within six pictures."""


@dataclass(frozen=True, slots=True)
class Config(BuildsItself):
    """Settings of a board that hides the target: the time at which it has arrived, after a slide of
    0.2 s from the left of the picture, and for how long it stays [s]; and how far to the left of
    the line of sight to the target it stops [m].
    """

    props = ()
    start: Time = 4.0
    """Time at which the board has arrived [s]."""
    duration: Time = 0.5
    """Time for which the board stays [s]."""
    offset: Annotated[float, Ge(0), Le(5)] = 0.0
    """Distance from the line of sight to the target, to the left in the picture, at which the board
    stops [m]. With 0 it slides out to the right, with another value to the left again; from 0.12 to
    0.26 it hides a part of the target only.
    """

    def at(self, time: float) -> Effect:
        # Fully hidden means within the board's own rim, which its slide has passed a moment before
        # it stops.
        ends = self.start + self.duration
        times = (self.start - SLIDE, self.start, ends, ends + SLIDE)
        if not times[0] <= time <= times[-1]:
            return Effect()
        end = DISTANCE if self.offset == 0 else -DISTANCE
        places = (-DISTANCE, -self.offset, -self.offset, end)
        return Effect(board=float(np.interp(time, times, places)))
