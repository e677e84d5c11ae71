"""Base class of the estimators without a filter, which return the error as it was measured."""

import numpy as np

from servo.parts import FeatureSet
from servo.types import OwnMotion, Prediction
from sim.types import Array


class Unfiltered:
    """Estimator that returns the error as it was measured, and the motion that a subclass sets in
    `measure`.
    """

    def start(self, features: FeatureSet) -> None:
        """Begin a run with a feature set: `motion`, the estimated de/dt (k,) of the target's own
        motion, is zero.
        """
        self.motion = np.zeros(len(features.names))

    def measure(self, error: Array, own: OwnMotion, dt: float) -> None:
        """Set `motion`, the estimated de/dt (k,) of the target's own motion, after a picture. This
        base class leaves it as it is.

        Args:
            error: Feature error (k,) over the features' scales; nan for features that were not
                measured.
            own: The part of de/dt that the camera's own motion causes.
            dt: Time since the last picture [s].
        """

    def update(self, error: Array, own: OwnMotion, dt: float) -> Prediction:
        """Return the measured error (0 where it is nan) and `motion`, after `measure` has set it.
        The arguments are those of `measure`.
        """
        self.measure(error, own, dt)
        return Prediction.unmeasured(np.nan_to_num(error), self.motion)

    def skip(self, own: OwnMotion, dt: float) -> Prediction:
        """Return an error of zero and the last `motion`, for a frame in which the target was not
        seen; the arguments are not used.
        """
        return Prediction.unmeasured(np.zeros_like(self.motion), self.motion)
