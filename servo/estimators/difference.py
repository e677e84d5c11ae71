"""The change of the error that the camera's motion does not explain (Teuliere, Marchand, Eck,
equation 18).
"""

from dataclasses import dataclass
from typing import final

import numpy as np

from servo.estimators._unfiltered import Unfiltered
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
class Plain(Unfiltered):
    """Returns the measured difference, unfiltered."""

    def start(self, features: FeatureSet) -> None:
        """Begin a run with a feature set, and a motion of zero."""
        super().start(features)
        self._difference = Difference(features)

    def measure(self, error: Array, own: OwnMotion, dt: float) -> None:
        """Set the motion to the difference since the last frame; features that were not measured in
        both frames keep their last one.
        """
        self.motion, _ = self._difference.measure(error, own.past, dt)

    def skip(self, own: OwnMotion, dt: float) -> Prediction:
        """Return an error of zero, and the last motion; the next difference needs two frames."""
        self._difference.forget()
        return super().skip(own, dt)
