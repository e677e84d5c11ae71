"""Estimator with a Kalman filter of a nearly constant target acceleration (ViSP's model with a
third state).

With noise = "difference", for each feature separately, with the frame interval T: z, the change of
the error per second less the part that the camera's own motion causes, measures x, the de/dt of the
target's own motion. nu is a change of x that decays by rho, and a a nearly constant one; w1 and w2
are white noises of variances sQ and sQ2, sR is that of z:

    x+ = x + nu + T a    nu+ = rho nu + w1    a+ = a + w2
    F = [[1, 1, T], [0, rho, 0], [0, 0, 1]]    H = [1, 0, 0]    Q = diag(0, sQ, sQ2)    R = sR

By default (noise = "position"), a filter with the same F measures the error itself, and the
camera's motion is its known input: see kalman_cv.
"""

from dataclasses import dataclass

import numpy as np

from servo.estimators._difference_filters import (
    DifferenceFilters,
    Memory,
    Noise,
    Ratio,
    between,
    difference_variance,
)
from servo.estimators._error_filters import ErrorFilters, TargetModel
from servo.estimators._kalman_filters import Model
from servo.parts import Estimator
from sim.channels import Channel, Channels
from sim.types import Array

# sQ / sR and sQ2 T^2 / sR, tuned at both rates: a slow camera sees a faster changing velocity.
VELOCITY_AT_30_HZ = 0.06
VELOCITY_AT_5_HZ = 1.0
ACCELERATION_AT_30_HZ = 3e-3
ACCELERATION_AT_5_HZ = 0.1


@dataclass(frozen=True, slots=True)
class Config:
    """Settings of the Kalman filter of a nearly constant target acceleration: the decay of velocity
    changes (`rho`), two ratios that give its three variances, of which only the ratios change the
    estimate, and whether it filters errors or their differences (`noise`).
    """

    rho: Memory = 0.5
    """Share of the velocity's change that is left in the next frame."""
    ratio: Ratio | None = None
    """Ratio sQ / sR of two variances, that of the noise of the velocity's change per frame, and
    that of a measured difference per second, 2 s^2 / T^2 for errors with the variance s^2 and the
    frame interval T; by default tuned for the camera's rate."""
    acceleration_ratio: Ratio | None = None
    """Ratio sQ2 T^2 / sR, with the variance sQ2 of the noise of the acceleration per frame, and the
    frame interval T; by default tuned for the camera's rate."""
    noise: Noise = "position"
    """Which noise is taken as white: that of the "position", or that of the "difference", as in
    ViSP."""

    @property
    def needs(self) -> Channels:
        """Kinds of additional data (channels) that the estimator needs: whether the target is seen
        (`Channel.SEEN`), if it filters the error; none if it filters differences.
        """
        return frozenset() if self.noise == "difference" else frozenset({Channel.SEEN})

    def build(self, rng: np.random.Generator) -> Estimator:
        """Return the estimator: a Kalman filter of the feature errors or, with noise =
        "difference", of their differences. It uses no random numbers.
        """
        if self.noise == "difference":
            return DifferenceFilters(self.model)
        return ErrorFilters(self.motion)

    def model(self, dt: float, variance: float) -> Model:
        """Return the matrices of ViSP's Kalman filter of one feature. It measures the change of the
        feature's error per second; its state is (x, nu, a): the rate x of the error from the
        target's own motion [1/s], a decaying change nu of x per frame, and a nearly constant
        acceleration a [1/s^2].

        Args:
            dt: Frame interval [s].
            variance: Variance of the noise of the feature itself (over its scale), before the
                difference is taken.
        """
        sR = difference_variance(variance, dt)
        rho = self.rho
        T = dt
        ratio, acceleration = self._ratios(dt)
        sQ = sR * ratio
        sQ2 = sR * acceleration / T**2
        s = sQ / (1 - rho**2)
        P = np.array(
            [
                [sR, 0.0, sR / T],
                [0.0, s, -rho * s / T],
                [sR / T, -rho * s / T, (2 * sR + s) / T**2],
            ]
        )
        return Model(self._F(T), np.zeros(3), np.eye(3)[0], np.diag([0.0, sQ, sQ2]), sR, P)

    def motion(self, dt: float) -> TargetModel:
        """Return the linear model by which the target's motion, of a nearly constant acceleration,
        changes the error of one feature from frame to frame. Its state is (x, nu, a): the rate x of
        the error from this motion, a decaying change nu of x per frame, and an acceleration a.
        Covariances are over the variance of the error's measurement.

        Args:
            dt: Frame interval [s].
        """
        sR = difference_variance(1.0, dt)
        M = self._F(dt)
        ratio, acceleration = self._ratios(dt)
        Q = sR * np.diag([0.0, ratio, acceleration / dt**2])
        P = sR * np.diag([0.0, ratio / (1 - self.rho**2), 2 / dt**2])
        return TargetModel(M, dt * M[0], Q, P)

    def _ratios(self, dt: float) -> tuple[float, float]:
        return (
            self.ratio or between(VELOCITY_AT_30_HZ, VELOCITY_AT_5_HZ, dt),
            self.acceleration_ratio or between(ACCELERATION_AT_30_HZ, ACCELERATION_AT_5_HZ, dt),
        )

    def _F(self, T: float) -> Array:
        return np.array([[1.0, 1.0, T], [0.0, self.rho, 0.0], [0.0, 0.0, 1.0]])
