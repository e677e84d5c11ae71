"""A board slides between camera and target, stays there, and slides out again."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, final

import numpy as np
from annotated_types import Ge, Le

from sim.ranges import Interval, Place, Time
from sim.types import Effect


@dataclass(frozen=True, slots=True)
class Config:
    """When and how fast."""

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

    def build(self, rng: np.random.Generator) -> Board:
        """The disturbance; draws nothing."""
        return Board(self)


@final
class Board:
    """In from one side, out to the other."""

    props: tuple[str, ...] = ()

    def __init__(self, config: Config) -> None:
        c = config
        # Fully hidden means within the board's own rim, which its slide has passed a moment before
        # it stops.
        self._times = (
            c.start - c.slide,
            c.start,
            c.start + c.duration,
            c.start + c.duration + c.slide,
        )
        end = c.distance if c.offset == 0 else -c.distance
        self._places = (-c.distance, -c.offset, -c.offset, end)

    def at(self, time: float) -> Effect:
        """The effect at a time [s]."""
        if not self._times[0] <= time <= self._times[-1]:
            return Effect()
        return Effect(board=float(np.interp(time, self._times, self._places)))
