"""The true motion of the target, for comparison only: ideal feed-forward, which no camera can see.

The loop has no truth; the simulation gives it with each frame (`motion_true` of `Loop.step`).
"""

from dataclasses import dataclass
from typing import final

import numpy as np

from servo.parts import FeatureSet
from servo.types import OwnMotion, Prediction
from sim.types import Array


@dataclass(frozen=True, slots=True)
class Config:
    """No settings."""

    def build(self, rng: np.random.Generator) -> "Ideal":
        """Return the estimator; it draws nothing."""
        return Ideal()


@final
class Ideal:
    """Returns the motion that was given last; zero before."""

    def start(self, features: FeatureSet) -> None:
        """Begin with these features."""
        self._motion = np.zeros(len(features.names))

    def give(self, motion: Array) -> None:
        """Take the true de/dt (k,) of the target's own motion while the next command acts, over the
        features' scales.
        """
        self._motion = motion

    def update(self, error: Array, own: OwnMotion, dt: float) -> Prediction:
        """Return the truth, and the error as it was seen."""
        return Prediction.unmeasured(np.nan_to_num(error), self._motion)

    def skip(self, own: OwnMotion, dt: float) -> Prediction:
        """Return the truth."""
        return Prediction.unmeasured(np.zeros_like(self._motion), self._motion)
