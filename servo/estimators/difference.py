"""Estimator without a filter: the change of the error that the camera's own motion does not explain
(Teuliere, Marchand, Eck, equation 18).
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
    """Settings of the estimator `difference`: it has none."""

    def build(self, rng: np.random.Generator) -> "Plain":
        """Return the estimator, which uses no random numbers."""
        return Plain()


@final
class Plain(Unfiltered):
    """Estimator that returns the measured difference (e - e_before) / dt minus the camera's part,
    unfiltered.
    """

    def start(self, features: FeatureSet) -> None:
        """Begin a run with a feature set: the motion is zero, and there is no error before."""
        super().start(features)
        self._difference = Difference(features)

    def measure(self, error: Array, own: OwnMotion, dt: float) -> None:
        """Set the motion to the difference of the error since the last picture, minus the camera's
        part. Features that were not measured in both pictures keep their last motion.
        """
        self.motion, _ = self._difference.measure(error, own.past, dt)

    def skip(self, own: OwnMotion, dt: float) -> Prediction:
        """Return an error of zero and the last motion, for a frame in which the target was not
        seen; the next difference then needs two pictures with the target.
        """
        self._difference.forget()
        return super().skip(own, dt)
