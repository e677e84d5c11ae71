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
    """sQ / sR, per frame; by default tuned for the camera's rate."""
    noise: Noise = "position"
    """Which noise is taken as white: that of the "position", or that of the "difference", as in
    ViSP."""

    @property
    def needs(self) -> Channels:
        """Channels of data that the estimator needs: `Channel.SEEN` if it filters the error; none
        if it filters differences.
        """
        return frozenset() if self.noise == "difference" else frozenset({Channel.SEEN})

    def build(self, rng: np.random.Generator) -> Estimator:
        """Return the estimator: a filter of the errors, or, with noise = "difference", of their
        differences. It uses no random numbers.
        """
        if self.noise == "difference":
            return DifferenceFilters(self.model)
        return ErrorFilters(lambda dt: motion(dt, self.rho, self.ratio))

    def model(self, dt: float, variance: float) -> Model:
        """Return the matrices of ViSP's Kalman filter of one feature, which measures the change of
        the feature's error per second.

        Args:
            dt: Frame interval [s].
            variance: Variance of the feature's measurement noise, before the difference is taken.
        """
        sR = difference_variance(variance, dt)
        rho = self.rho
        sQ = sR * (self.ratio or between(RATIO_AT_30_HZ, RATIO_AT_5_HZ, dt))
        F = np.array([[1.0, 1.0], [0.0, rho]])
        P = np.diag([sR, sQ / (1 - rho**2)])
        return Model(F, np.zeros(2), np.eye(2)[0], np.diag([0.0, sQ]), sR, P)


def motion(dt: float, rho: float, ratio: float | None) -> TargetModel:
    """Return the model of how the target's motion, of a nearly constant velocity, changes a
    feature's error from frame to frame.

    Args:
        dt: Frame interval [s].
        rho: Share of the velocity's change that is left in the next frame, 0 to 1.
        ratio: Variance of the velocity's noise over that of the measurement, sQ / sR, per frame;
            None: the value tuned for this frame interval.
    """
    ratio = ratio or between(RATIO_AT_30_HZ, RATIO_AT_5_HZ, dt)
    sQ = ratio * difference_variance(1.0, dt)
    M = np.array([[1.0, 1.0], [0.0, rho]])
    P = np.diag([0.0, sQ / (1 - rho**2)])
    return TargetModel(M, dt * M[0], np.diag([0.0, sQ]), P)
