"""No estimate: the target is taken to stand still, and a moving one is followed with a lag."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from servo.types import Outlook, OwnMotion
from sim.types import Array


@dataclass(frozen=True, slots=True)
class Config:
    """Nothing to set."""

    def build(self, rng: np.random.Generator) -> Nothing:
        """The estimator; draws nothing."""
        return Nothing()


@final
class Nothing:
    """Always zero."""

    def update(self, error: Array, own: OwnMotion, dt: float) -> Outlook:
        """No motion."""
        return Outlook.plain(error, np.zeros(4))

    def skip(self, own: OwnMotion, dt: float) -> Outlook:
        """No motion."""
        return Outlook.plain(np.zeros(4), np.zeros(4))
