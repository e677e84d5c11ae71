"""Nothing at all: the target stays where it was first seen. The baseline that every tracker must
beat.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from sim.types import Array, Frame
from tracking.types import Estimate, Region, State, Status, check_region


@dataclass(frozen=True, slots=True)
class Config:
    """Nothing to set."""

    def build(self, rng: np.random.Generator) -> Frozen:
        """The tracker; draws nothing."""
        return Frozen()


@final
class Frozen:
    """Always the first state, and honest about knowing nothing more."""

    def start(self, frame: Frame, region: Region, state: State) -> None:
        """Remember the first state."""
        check_region(frame, region, state)
        self._state, self._since = state, frame.time

    def update(self, frame: Frame, ego: Array | None = None) -> Estimate:
        """The first state, carried along if told; UNSURE, because nobody looked."""
        self._state = self._state.moved(ego)
        return Estimate(self._state, np.zeros((4, 4)), 1.0, Status.UNSURE)
