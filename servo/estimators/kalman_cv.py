"""Estimator with a Kalman filter of a nearly constant target velocity (Teuliere, Marchand, Eck,
equation 19).

ViSP's model, with noise = "difference", for each feature separately: z, the change of the error per
second less the part that the camera's own motion causes, measures x, the de/dt of the target's own
motion. nu is a change of x that decays by rho; w is white noise of variance sQ, sR is that of z:

    x+ = x + nu    nu+ = rho nu + w
    F = [[1, 1], [0, rho]]    H = [1, 0]    Q = diag(0, sQ)    R = sR

Two differences in a row share the noise of a position, so z's noise is not white. By default, noise
= "position", a filter with the same F measures the error itself, whose noise is white, and the
camera's motion is its known input. If the target reverses, a filter that is too slow is worse than
none, so the default constants depend on the camera's rate.
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

RHO = 0.6
"""Memory of the velocity's change from frame to frame, tuned with the ratios."""
# sQ / sR, tuned at both rates: a slow camera sees a faster changing velocity.
RATIO_AT_30_HZ = 0.04
RATIO_AT_5_HZ = 3.0


@dataclass(frozen=True, slots=True)
class Config:
    """Settings of the Kalman filter of a nearly constant target velocity: the decay of velocity
    changes (`rho`), the ratio of its two variances, which alone changes the estimate, and whether
    it filters errors or their differences (`noise`).
    """

    rho: Memory = RHO
    """Share of the velocity's change that is left in the next frame."""
    ratio: Ratio | None = None
    """Ratio sQ / sR of two variances, that of the noise of the velocity's change per frame, and
    that of a measured difference per second, 2 s^2 / T^2 for errors with the variance s^2 and the
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
        "difference", of their differences between pictures. It uses no random numbers.
        """
        if self.noise == "difference":
            return DifferenceFilters(self.model)
        return ErrorFilters(lambda dt: motion(dt, self.rho, self.ratio))

    def model(self, dt: float, variance: float) -> Model:
        """Return the matrices of ViSP's Kalman filter of one feature. It measures the change of the
        feature's error per second; its state is (x, nu): the rate x of the error from the target's
        own motion [1/s], and a decaying change nu of x per frame.

        Args:
            dt: Frame interval [s].
            variance: Variance of the noise of the feature itself (over its scale), before the
                difference is taken.
        """
        sR = difference_variance(variance, dt)
        rho = self.rho
        sQ = sR * (self.ratio or between(RATIO_AT_30_HZ, RATIO_AT_5_HZ, dt))
        F = np.array([[1.0, 1.0], [0.0, rho]])
        P = np.diag([sR, sQ / (1 - rho**2)])
        return Model(F, np.zeros(2), np.eye(2)[0], np.diag([0.0, sQ]), sR, P)


def motion(dt: float, rho: float, ratio: float | None) -> TargetModel:
    """Return the linear model by which the target's motion, of a nearly constant velocity, changes
    the error of one feature from frame to frame. Its state is (x, nu): the rate x of the error from
    this motion, and a decaying change nu of x per frame. Covariances are over the variance of the
    error's measurement.

    Args:
        dt: Frame interval [s].
        rho: Share of nu that is left in the next frame, 0 to below 1.
        ratio: Ratio sQ / sR of two variances: that of the noise of nu per frame, and that of the
            difference of two measurements per second; None: the value tuned for this frame
            interval.
    """
    ratio = ratio or between(RATIO_AT_30_HZ, RATIO_AT_5_HZ, dt)
    sQ = ratio * difference_variance(1.0, dt)
    M = np.array([[1.0, 1.0], [0.0, rho]])
    P = np.diag([0.0, sQ / (1 - rho**2)])
    return TargetModel(M, dt * M[0], np.diag([0.0, sQ]), P)
