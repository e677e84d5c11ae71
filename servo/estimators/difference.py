"""Estimator of the target's motion without a filter: the change of the feature error that the
camera's own motion does not explain (Teuliere, Marchand, Eck, equation 18).
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
    """The estimator `difference` has no settings."""

    def build(self, rng: np.random.Generator) -> "Plain":
        """Return the estimator, which uses no random numbers."""
        return Plain()


@final
class Plain(Unfiltered):
    """Estimator that returns, as de/dt of the target's own motion, the unfiltered difference of the
    errors in two successive pictures over their interval, minus the part of the camera's motion.
    """

    def start(self, features: FeatureSet) -> None:
        """Begin a run with a feature set: the estimated motion is zero, no error was measured."""
        super().start(features)
        self._difference = Difference(features)

    def measure(self, error: Array, own: OwnMotion, dt: float) -> None:
        """Set `motion`, the estimated de/dt (k,) of the target's own motion [1/s], to the change of
        the error (over the features' scales) since the last picture over dt [s], minus the part of
        the camera's motion. Its value stays for features that were not measured in both pictures.
        """
        self.motion, _ = self._difference.measure(error, own.past, dt)

    def skip(self, own: OwnMotion, dt: float) -> Prediction:
        """Return an error of zero and the last estimated de/dt, for a frame in which the target was
        not seen; the next difference then needs two pictures with the target.
        """
        self._difference.forget()
        return super().skip(own, dt)
