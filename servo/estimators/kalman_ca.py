"""Kalman filter of a nearly constant target acceleration (ViSP's model with a third state).

For each feature by itself, with the plain difference z as measurement and T the frame interval:

    x+ = x + nu + T a    nu+ = rho nu + w1    a+ = a + w2
    F = [[1, 1, T], [0, rho, 0], [0, 0, 1]]    H = [1, 0, 0]    Q = diag(0, sQ, sQ2)    R = sR
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

VELOCITY_AT_30_HZ, VELOCITY_AT_5_HZ = 0.03, 1.0
ACCELERATION_AT_30_HZ, ACCELERATION_AT_5_HZ = 3e-3, 0.1
"""Tuned sQ / sR and sQ2 T^2 / sR: a slow camera sees a faster changing velocity."""


@dataclass(frozen=True, slots=True)
class Config:
    """Constants of the filter; only the ratios of the variances matter to the estimate."""

    rho: Memory = 0.5
    """Memory of the velocity's change from frame to frame."""
    state_variance: Variance | None = None
    """sQ, per frame [(1/s)^2]; by default what suits the camera's rate."""
    acceleration_variance: Variance | None = None
    """sQ2, per frame [(1/s^2)^2]; by default what suits the camera's rate."""
    measure_variance: Variance | None = None
    """sR [(1/s)^2]; by default that of a good tracker's differences at the camera's rate."""

    def build(self, rng: np.random.Generator) -> FeatureFilters:
        """The estimator; draws nothing."""
        return FeatureFilters(self.model)

    def model(self, dt: float, variance: float) -> Model:
        """The filter of a feature that is measured with this variance, at a frame interval [s]."""
        sR, rho, T = self.measure_variance or difference_variance(variance, dt), self.rho, dt
        sQ = self.state_variance or sR * between(VELOCITY_AT_30_HZ, VELOCITY_AT_5_HZ, dt)
        sQ2 = self.acceleration_variance or (
            sR * between(ACCELERATION_AT_30_HZ, ACCELERATION_AT_5_HZ, dt) / T**2
        )
        s = sQ / (1 - rho**2)
        F = np.array([[1.0, 1.0, T], [0.0, rho, 0.0], [0.0, 0.0, 1.0]])
        Q = np.diag([0.0, sQ, sQ2])
        P = np.array(
            [
                [sR, 0.0, sR / T],
                [0.0, s, -rho * s / T],
                [sR / T, -rho * s / T, (2 * sR + s) / T**2],
            ]
        )
        return Model(F, Q, sR, P)
