"""No estimate: the law assumes a target at rest, and follows a moving one with a lag."""

from dataclasses import dataclass
from typing import final

import numpy as np

from servo.parts import FeatureSet
from servo.types import OwnMotion, Prediction
from sim.types import Array


@dataclass(frozen=True, slots=True)
class Config:
    """This estimator has no settings."""

    def build(self, rng: np.random.Generator) -> "Nothing":
        """Return the estimator, which uses no random numbers."""
        return Nothing()


@final
class Nothing:
    """Predicts a target at rest."""

    def start(self, features: FeatureSet) -> None:
        """Begin a run with a feature set."""
        self._zero = np.zeros(len(features.names))

    def update(self, error: Array, own: OwnMotion, dt: float) -> Prediction:
        """Return the error as it was measured, and a motion of zero."""
        return Prediction.unmeasured(np.nan_to_num(error), self._zero)

    def skip(self, own: OwnMotion, dt: float) -> Prediction:
        """Return an error and a motion of zero."""
        return Prediction.unmeasured(self._zero, self._zero)
