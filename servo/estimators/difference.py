"""The plain difference (Teuliere, Marchand, Eck, equation 18): what the camera's motion does not
explain.
"""

from dataclasses import dataclass
from typing import final

import numpy as np

from servo.parts import FeatureSet
from servo.sight.difference import Difference
from servo.types import OwnMotion, Prediction
from sim.types import Array


@dataclass(frozen=True, slots=True)
class Config:
    """No settings."""

    def build(self, rng: np.random.Generator) -> "Plain":
        """Return the estimator, which uses no random numbers."""
        return Plain()


@final
class Plain:
    """The difference as it is."""

    def start(self, features: FeatureSet) -> None:
        """Begin with these features."""
        self._difference = Difference(features)

    def update(self, error: Array, own: OwnMotion, dt: float) -> Prediction:
        """Return the last measurement."""
        motion, _ = self._difference.measure(error, own.past, dt)
        return Prediction.unmeasured(np.nan_to_num(error), motion)

    def skip(self, own: OwnMotion, dt: float) -> Prediction:
        """Return the last measurement, kept."""
        self._difference.forget()
        return Prediction.unmeasured(np.zeros_like(self._difference.value), self._difference.value)
