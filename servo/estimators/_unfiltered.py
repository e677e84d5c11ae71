"""Base of the estimators without a filter: they return the error as it was measured."""

import numpy as np

from servo.parts import FeatureSet
from servo.types import OwnMotion, Prediction
from sim.types import Array


class Unfiltered:
    """Returns the error as it was measured, and the last estimated motion."""

    def start(self, features: FeatureSet) -> None:
        """Begin a run with a feature set, and a motion of zero."""
        self.motion = np.zeros(len(features.names))

    def measure(self, error: Array, own: OwnMotion, dt: float) -> None:
        """Set `motion`, the estimated de/dt (k,), after a frame; here it stays as it is.

        Args:
            error: Feature error (k,); nan for features that were not measured.
            own: The part of de/dt that the camera's own motion causes.
            dt: Time since the last frame [s].
        """

    def update(self, error: Array, own: OwnMotion, dt: float) -> Prediction:
        """Return a prediction: the measured error, 0 for features that were not measured, and the
        estimated motion.
        """
        self.measure(error, own, dt)
        return Prediction.unmeasured(np.nan_to_num(error), self.motion)

    def skip(self, own: OwnMotion, dt: float) -> Prediction:
        """Return the prediction without a measurement: an error of zero, the last motion."""
        return Prediction.unmeasured(np.zeros_like(self.motion), self.motion)
