"""The change of the error that the camera's motion does not explain (Teuliere, Marchand, Eck,
equation 18).
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
    """This estimator has no settings."""

    def build(self, rng: np.random.Generator) -> "Plain":
        """Return the estimator, which uses no random numbers."""
        return Plain()


@final
class Plain:
    """Returns the measured difference, unfiltered."""

    def start(self, features: FeatureSet) -> None:
        """Begin a run with a feature set."""
        self._difference = Difference(features)

    def update(self, error: Array, own: OwnMotion, dt: float) -> Prediction:
        """Return the difference since the last frame as the target's motion; features that were not
        measured in both frames keep their last one.
        """
        motion, _ = self._difference.measure(error, own.past, dt)
        return Prediction.unmeasured(np.nan_to_num(error), motion)

    def skip(self, own: OwnMotion, dt: float) -> Prediction:
        """Return the last measured difference."""
        self._difference.forget()
        return Prediction.unmeasured(np.zeros_like(self._difference.value), self._difference.value)
