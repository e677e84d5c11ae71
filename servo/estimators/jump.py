"""Estimator with the Kalman filter of kalman_cv, which forgets its velocity when the target's
velocity jumps (CUSUM, Page 1954).

Two sums for each feature run over the innovation nu, divided by its standard deviation:

    g+ = max(0, g+ + nu - drift)    g- = max(0, g- - nu - drift)

If a sum passes the threshold, the velocity has jumped: the filter then forgets its velocity.
"""

from dataclasses import dataclass
from functools import partial
from typing import final

import numpy as np

from servo.estimators._difference_filters import between
from servo.estimators._error_filters import ErrorFilters, TargetModel
from servo.estimators._kalman_filters import Flags
from servo.estimators.kalman_cv import RATIO_AT_5_HZ, RHO, motion
from sim.channels import Channel
from sim.types import Array

RATIO_AT_30_HZ = 0.15
"""Ratio sQ / sR at 30 Hz, tuned on the scenarios: velocities also change between jumps."""
# Chosen by hand on the scenarios whose target reverses. With both, white noise alone passes the
# threshold of a feature once in some 470 frames.
DRIFT = 0.75
"""Innovation that is not counted [standard deviations]."""
THRESHOLD = 3.5
"""Sum from which a jump is detected [standard deviations]."""


@dataclass(frozen=True, slots=True)
class Config:
    """The estimator `jump` has no settings."""

    needs = frozenset({Channel.SEEN})

    def build(self, rng: np.random.Generator) -> ErrorFilters:
        """Return the estimator, a Kalman filter of each feature's error with a test for jumps of
        the target's velocity. It uses no random numbers.
        """
        return ErrorFilters(_model, test=partial(Cusum, DRIFT, THRESHOLD))


def _model(dt: float) -> TargetModel:
    return motion(dt, RHO, between(RATIO_AT_30_HZ, RATIO_AT_5_HZ, dt))


@final
class Cusum:
    """Test that finds jumps of the features' velocities. For each feature it keeps two cumulative
    sums (CUSUM), upwards and downwards, of the innovations over their standard deviations. From
    each innovation `drift` is subtracted; a sum above `threshold` is a jump.
    """

    def __init__(self, drift: float, threshold: float) -> None:
        self._drift = drift
        self._threshold = threshold
        self._sums = np.zeros((2, 1))

    def jumped(self, normalised: Array) -> Flags:
        """Add the innovations of a picture to the sums. Return True (k,) for each feature one of
        whose sums is above the threshold, and set its two sums to zero.

        Args:
            normalised: Innovations (k,) over their standard deviations; 0 for features that were
                not measured.
        """
        both = np.stack([normalised, -normalised])
        self._sums = np.maximum(0.0, self._sums + both - self._drift)
        found = np.any(self._sums > self._threshold, axis=0)
        self._sums[:, found] = 0.0
        return found
