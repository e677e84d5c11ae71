"""Kalman filter of a nearly constant target velocity (Teuliere, Marchand, Eck, equation 19).

ViSP's model; for each feature by itself, with the plain difference z as measurement:

    x+ = x + nu    nu+ = rho nu + w
    F = [[1, 1], [0, rho]]    H = [1, 0]    Q = diag(0, sQ)    R = sR

A slow filter is worse than none where the target reverses, so the constants must fit the camera's
rate: those that are not given come from two tuned rates.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from servo.estimators._kalman import (
    FeatureFilters,
    Memory,
    Model,
    Variance,
    between,
    difference_variance,
)

RHO = 0.6
RATIO_AT_30_HZ, RATIO_AT_5_HZ = 0.03, 3.0
"""Tuned sQ / sR: a slow camera sees a faster changing velocity."""


@dataclass(frozen=True, slots=True)
class Config:
    """Constants of the filter; only the ratio of the variances matters to the estimate."""

    rho: Memory = RHO
    """Memory of the velocity's change from frame to frame."""
    state_variance: Variance | None = None
    """sQ, per frame [(1/s)^2]; by default what suits the camera's rate."""
    measure_variance: Variance | None = None
    """sR [(1/s)^2]; by default that of a good tracker's differences at the camera's rate."""

    def build(self, rng: np.random.Generator) -> FeatureFilters:
        """The estimator; draws nothing."""
        return FeatureFilters(self.model)

    def model(self, dt: float, variance: float) -> Model:
        """The filter of a feature that is measured with this variance, at a frame interval [s]."""
        sR, rho = self.measure_variance or difference_variance(variance, dt), self.rho
        sQ = self.state_variance or sR * between(RATIO_AT_30_HZ, RATIO_AT_5_HZ, dt)
        F = np.array([[1.0, 1.0], [0.0, rho]])
        return Model(F, np.diag([0.0, sQ]), sR, np.diag([sR, sQ / (1 - rho**2)]))
