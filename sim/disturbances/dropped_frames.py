"""Disturbance: the camera drops frames at random times, which are the same for every frame rate."""

from dataclasses import dataclass
from math import floor
from typing import final

import numpy as np

from sim.ranges import Share
from sim.types import Effect

LENGTH = 0.03
"""Length of the time slots in which all frames are dropped or none [s]: about a frame at 30 Hz."""
START = 0.5
"""No frame is dropped before this time [s], so that trackers begin with pictures."""


@dataclass(frozen=True, slots=True)
class Config:
    """Settings of the dropped frames: the share of the time in which frames are dropped, 0 to 1."""

    share: Share = 0.2
    """Share of the time in which frames are dropped."""

    def build(self, rng: np.random.Generator) -> "DroppedFrames":
        """Return the disturbance; the times at which it drops frames follow from a seed that is
        drawn from `rng`.
        """
        return DroppedFrames(self.share, int(rng.integers(2**31)))


@final
@dataclass(frozen=True, slots=True)
class DroppedFrames:
    """Disturbance that drops all frames in randomly chosen time slots of 0.03 s, from 0.5 s on;
    each slot is chosen independently of all others, with the probability `share`.
    """

    share: float
    """Share of the slots in which frames are dropped."""
    seed: int
    """Seed of the draws, one for each slot."""
    props: tuple[str, ...] = ()

    def at(self, time: float) -> Effect:
        if time < START:
            return Effect()
        slot = floor(time / LENGTH)
        return Effect(dropped=np.random.default_rng([self.seed, slot]).random() < self.share)
