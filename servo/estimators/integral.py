"""Estimator that makes the law a proportional-integral one: the sum of the errors replaces an
estimate of the target's motion (P. I. Corke, M. C. Good, Dynamic effects in visual closed-loop
systems, 1996).
"""

from dataclasses import dataclass
from typing import Annotated, final

import numpy as np
from annotated_types import Ge, Le

from servo.estimators._unfiltered import Unfiltered
from servo.parts import FeatureSet
from servo.types import OwnMotion
from sim.types import Array


@dataclass(frozen=True, slots=True)
class Config:
    """Settings of the estimator `integral`: its gain [1/s^2]. With a law of gain g [1/s] and the
    feature error e, the camera twist is -L# (g e + gain * integral of e), with the integral only
    for the features that the law feeds forward.
    """

    gain: Annotated[float, Ge(0), Le(1000)] = 2.0
    """Gain of the integral [1/s^2]."""

    def build(self, rng: np.random.Generator) -> "Integral":
        """Return the estimator, which uses no random numbers."""
        return Integral(self.gain)


@final
class Integral(Unfiltered):
    """Estimator that returns the measured feature error, and in place of its rate de/dt from the
    target's own motion the gain [1/s^2] times the integral of the error over time. The law adds
    this term for the features that it feeds forward.
    """

    def __init__(self, gain: float) -> None:
        self._gain = gain

    def start(self, features: FeatureSet) -> None:
        """Begin a run with a feature set: the integral of each feature's error is zero."""
        super().start(features)
        self._sum = np.zeros(len(features.names))

    def measure(self, error: Array, own: OwnMotion, dt: float) -> None:
        """Add the error times `dt` to its integral, and set `motion` (k,), the rate that `update`
        returns, to the gain times the integral. The integral of a feature that is not measured
        stays.

        Args:
            error: Feature error (k,) over the features' scales; nan for features that were not
                measured.
            own: Not used.
            dt: Time since the last picture [s].
        """
        self._sum = self._sum + np.nan_to_num(error) * dt
        self.motion = self._gain * self._sum
