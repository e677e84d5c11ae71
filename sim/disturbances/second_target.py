"""A second target, the first one's twin, drives straight across the table."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from sim.motions import line
from sim.ranges import Degrees, Place, Speed, Time
from sim.types import Effect


@dataclass(frozen=True, slots=True)
class Config:
    """When it comes, and how it drives."""

    start: Time = 3.0
    """When it appears [s]."""
    duration: Time = 6.0
    """How long it is there [s]."""
    x: Place = 0.0
    """Where it appears [m]."""
    y: Place = -0.6
    """Where it appears [m]."""
    heading_deg: Degrees = 90.0
    """Direction of the drive, from world x towards y [deg]."""
    speed: Speed = 0.2
    """Speed [m/s]."""

    def build(self, rng: np.random.Generator) -> SecondTarget:
        """The disturbance; draws nothing."""
        return SecondTarget(self)


@final
class SecondTarget:
    """There for a while, driving."""

    props: tuple[str, ...] = ("second_target",)

    def __init__(self, config: Config) -> None:
        c = self._config = config
        self._drive = line.Line(line.Config(c.x, c.y, c.heading_deg, c.speed))

    def at(self, time: float) -> Effect:
        """The effect at a time [s]."""
        since = time - self._config.start
        if not 0 <= since <= self._config.duration:
            return Effect()
        return Effect(second=self._drive.at(since))
