"""Kalman filter on the error itself, with the measured camera motion as known input.

A difference of two frames doubles the noise and is half a frame old; this filter has neither fault.
It knows the commands that are under way, so it predicts the error over the delay, and goes on
predicting where the target is not seen. The motion of the target, with T the frame interval:

    d+ = d + T a + w1    a+ = rho a + w2    added to the error in a frame: T d + T^2/2 a
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Le

from servo.estimators._error_filter import ErrorFilters, TargetModel
from servo.estimators._kalman import Ratio, between

AT_30_HZ = 0.03
AT_5_HZ = 2.0
"""Tuned noise of the acceleration: a slow camera sees a faster changing velocity."""

SLOWEST = 0.2
"""Interval [s] above which a past acceleration says little: the memory then falls with its square,
or else each reversal is taken for the beginning of a faster drive."""


@dataclass(frozen=True, slots=True)
class Config:
    """Constants of the filter."""

    rho: Annotated[float, Ge(0), Le(0.999)] = 0.95
    """Memory of the acceleration from picture to picture, up to 0.2 s apart."""
    acceleration: Ratio | None = None
    """Noise of the acceleration over the measurement's, per frame: Var(w2) T^4 / R; by default
    what suits the camera's rate."""
    velocity: Annotated[float, Ge(0), Le(1e9)] = 0.0
    """Noise of the velocity over the measurement's, per frame: Var(w1) T^2 / R."""

    def build(self, rng: np.random.Generator) -> ErrorFilters:
        """The estimator; draws nothing."""
        return ErrorFilters(self.motion, predicts=True)

    def motion(self, dt: float) -> TargetModel:
        """How a target moves, at a frame interval [s]."""
        s = (self.acceleration or between(AT_30_HZ, AT_5_HZ, dt)) / dt**4
        Q = np.diag([self.velocity / dt**2, s])
        rho = self.rho * min(1.0, (SLOWEST / dt) ** 2)
        P = np.diag([0.0, s / (1 - rho**2)])
        M = np.array([[1.0, dt], [0.0, rho]])
        return TargetModel(M, np.array([dt, dt**2 / 2]), Q, P)
