"""The lamp dims, and a spot light from above brightens a part of the table."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, final

import numpy as np
from annotated_types import Ge, Le

from sim.ranges import Interval, Place, Time
from sim.types import Effect, Spot


@dataclass(frozen=True, slots=True)
class Config:
    """When, where and how bright."""

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
    strength: Annotated[float, Ge(0), Le(1)] = 0.4
    """Brightness of the spot."""
    lamp: Annotated[float, Ge(0), Le(1)] = 0.5
    """Factor on the lamp's brightness meanwhile: light that adds up to more than 1 is lost."""

    def build(self, rng: np.random.Generator) -> SpotLight:
        """The disturbance; draws nothing."""
        return SpotLight(self)


@final
class SpotLight:
    """A trapezoid over time."""

    props: tuple[str, ...] = ("spot",)

    def __init__(self, config: Config) -> None:
        c = self._config = config
        self._times = np.cumsum([c.start, c.ramp, c.duration, c.ramp])

    def at(self, time: float) -> Effect:
        """The effect at a time [s]."""
        c, share = self._config, float(np.interp(time, self._times, (0.0, 1.0, 1.0, 0.0)))
        if share == 0.0:
            return Effect()
        spot = Spot(c.x, c.y, share * c.strength)
        return Effect(lamp=1.0 - share * (1.0 - c.lamp), spot=spot)
