"""The brightness of the image goes to a factor over a ramp, stays there, and comes back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, final

import numpy as np
from annotated_types import Ge, Le

from sim.ranges import Interval, Time
from sim.types import Effect


@dataclass(frozen=True, slots=True)
class Config:
    """When, how much and how fast."""

    start: Time = 3.0
    """When the brightness begins to change [s]."""
    factor: Annotated[float, Ge(0), Le(100)] = 0.7
    """The factor it goes to."""
    ramp: Interval = 0.5
    """How long it takes to get there, and back [s]."""
    duration: Time = 2.0
    """How long it stays there [s]."""

    def build(self, rng: np.random.Generator) -> Brightness:
        """The disturbance; draws nothing."""
        return Brightness(self)


@final
class Brightness:
    """A trapezoid over time."""

    props: tuple[str, ...] = ()

    def __init__(self, config: Config) -> None:
        c = config
        self._times = np.cumsum([c.start, c.ramp, c.duration, c.ramp])
        self._factors = (1.0, c.factor, c.factor, 1.0)

    def at(self, time: float) -> Effect:
        """The effect at a time [s]."""
        return Effect(gain=float(np.interp(time, self._times, self._factors)))
