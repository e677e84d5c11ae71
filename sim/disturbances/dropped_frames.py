"""The camera drops frames at random times, which do not depend on its rate."""

from __future__ import annotations

from dataclasses import dataclass
from math import floor
from typing import final

import numpy as np

from sim.ranges import Interval, Share, Time
from sim.types import Effect


@dataclass(frozen=True, slots=True)
class Config:
    """How many, and for how long."""

    share: Share = 0.2
    """Share of the time in which frames are dropped."""
    length: Interval = 0.03
    """How long one drop lasts at least [s]."""
    start: Time = 0.5
    """No frame is dropped before [s]."""

    def build(self, rng: np.random.Generator) -> DroppedFrames:
        """The disturbance; the generator seeds its draws."""
        return DroppedFrames(self, int(rng.integers(2**31)))


@final
class DroppedFrames:
    """Time in slots; each slot's fate is a draw of its own."""

    props: tuple[str, ...] = ()

    def __init__(self, config: Config, seed: int) -> None:
        self._config = config
        self._seed = seed

    def at(self, time: float) -> Effect:
        c = self._config
        if time < c.start:
            return Effect()
        slot = floor(time / c.length)
        return Effect(dropped=np.random.default_rng([self._seed, slot]).random() < c.share)
