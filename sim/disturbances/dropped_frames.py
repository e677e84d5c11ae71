"""The camera drops frames at random times, which do not depend on its rate."""

from dataclasses import dataclass
from math import floor
from typing import final

import numpy as np

from sim.ranges import Share
from sim.types import Effect

LENGTH = 0.03
"""How long one drop lasts at least [s]: a frame at 30 Hz."""
START = 0.5
"""No frame is dropped before [s], so that trackers begin with pictures."""


@dataclass(frozen=True, slots=True)
class Config:
    """How many frames are dropped."""

    share: Share = 0.2
    """Share of the time in which frames are dropped."""

    def build(self, rng: np.random.Generator) -> "DroppedFrames":
        """The disturbance; the generator seeds its draws."""
        return DroppedFrames(self.share, int(rng.integers(2**31)))


@final
class DroppedFrames:
    """Time in slots; each slot's fate is a draw of its own."""

    props: tuple[str, ...] = ()

    def __init__(self, share: float, seed: int) -> None:
        self._share = share
        self._seed = seed

    def at(self, time: float) -> Effect:
        if time < START:
            return Effect()
        slot = floor(time / LENGTH)
        return Effect(dropped=np.random.default_rng([self._seed, slot]).random() < self._share)
