"""Kalman filter of a nearly constant target velocity (Teuliere, Marchand, Eck, equation 19).

ViSP's model; for each feature by itself, z its plain difference:

    x+ = x + nu    nu+ = rho nu + w
    F = [[1, 1], [0, rho]]    H = [1, 0]    Q = diag(0, sQ)    R = sR

Two differences in a row share the noise of a position, so R is not white. By default the same model
filters the error itself, where the noise is. A slow filter is worse than none where the target
reverses, so the constants must fit the camera's rate: the default comes from two tuned rates.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from servo.estimators._error_filter import ErrorFilters, TargetModel
from servo.estimators._filters import Model
from servo.estimators._kalman import (
    DifferenceFilters,
    Memory,
    Noise,
    Ratio,
    Variance,
    between,
    check_noise,
    difference_variance,
)
from servo.parts import Estimator

RHO = 0.6
RATIO_AT_30_HZ = 0.04
RATIO_AT_5_HZ = 3.0
"""Tuned sQ / sR: a slow camera sees a faster changing velocity."""


@dataclass(frozen=True, slots=True)
class Config:
    """Constants of the filter; only the ratio of the variances matters to the estimate."""

    rho: Memory = RHO
    """Memory of the velocity's change from frame to frame."""
    ratio: Ratio | None = None
    """sQ / sR, per frame; by default what suits the camera's rate."""
    noise: Noise = "position"
    """Where the noise is white: on the "position", or on the "difference", as in ViSP."""
    state_variance: Variance | None = None
    """sQ, per frame [(1/s)^2], with noise = "difference"; by default from the ratio."""
    measure_variance: Variance | None = None
    """sR [(1/s)^2], with noise = "difference"; by default that of a good tracker's differences at
    the camera's rate."""

    def __post_init__(self) -> None:
        check_noise(self.noise, self, "state_variance", "measure_variance")

    def build(self, rng: np.random.Generator) -> Estimator:
        """The estimator; draws nothing."""
        if self.noise == "difference":
            return DifferenceFilters(self.model)
        return ErrorFilters(lambda dt: motion(dt, self.rho, self.ratio))

    def model(self, dt: float, variance: float) -> Model:
        """ViSP's filter of a feature that is measured with this variance, at an interval [s]."""
        sR = self.measure_variance or difference_variance(variance, dt)
        rho = self.rho
        sQ = self.state_variance or sR * (self.ratio or between(RATIO_AT_30_HZ, RATIO_AT_5_HZ, dt))
        F = np.array([[1.0, 1.0], [0.0, rho]])
        P = np.diag([sR, sQ / (1 - rho**2)])
        return Model(F, np.zeros(2), np.eye(2)[0], np.diag([0.0, sQ]), sR, P)


def motion(dt: float, rho: float, ratio: float | None) -> TargetModel:
    """The same model for a filter of the error, at a frame interval [s]."""
    ratio = ratio or between(RATIO_AT_30_HZ, RATIO_AT_5_HZ, dt)
    sQ = ratio * difference_variance(1.0, dt)
    M = np.array([[1.0, 1.0], [0.0, rho]])
    P = np.diag([0.0, sQ / (1 - rho**2)])
    return TargetModel(M, dt * M[0], np.diag([0.0, sQ]), P)
