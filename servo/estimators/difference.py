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
    """Estimator that returns the measured feature error, and as its rate de/dt from the target's
    own motion the unfiltered difference of the errors in two successive pictures over their
    interval, minus the rate that the camera's own motion causes.
    """

    def start(self, features: FeatureSet) -> None:
        """Begin a run with a feature set: the estimated motion of the target is zero, and no error
        has been measured yet.
        """
        super().start(features)
        self._difference = Difference(features)

    def measure(self, error: Array, own: OwnMotion, dt: float) -> None:
        """Estimate the rate de/dt (k,) [1/s] of the feature error that the target's own motion
        causes, and store it as `motion`: the change of the error since the previous picture over
        `dt`, minus the rate that the camera's own motion causes. For a feature that was not
        measured in both pictures the last estimate stays.

        Args:
            error: Feature error (k,) over the features' scales; nan for features that were not
                measured.
            own: The rate of this error that the camera's own motion causes; only its mean since the
                previous picture is used.
            dt: Time since the previous picture [s].
        """
        self.motion, _ = self._difference.measure(error, own.past, dt)

    def skip(self, own: OwnMotion, dt: float) -> Prediction:
        """Return a feature error of zero and the last estimated motion, for a frame in which the
        target was not seen. The next estimate then needs two more pictures in a row with the
        target. The arguments are not used.
        """
        self._difference.forget()
        return super().skip(own, dt)
