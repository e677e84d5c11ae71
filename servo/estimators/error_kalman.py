"""Estimator with a Kalman filter of the error itself, which knows the measured camera motion as an
input.

A difference of two frames doubles the noise and is half a frame old; this filter avoids both. It
knows the commands that have not acted yet, so it predicts the error over the delay, and goes on
predicting while the target is not seen. The target's motion is a velocity d and an acceleration a
of the error, with the frame interval T, the memory rho, and white noises w1 and w2:

    d+ = d + T a + w1    a+ = rho a + w2    added to the error in a frame: T d + T^2/2 a
"""

from dataclasses import dataclass

import numpy as np

from servo.estimators._difference_filters import between
from servo.estimators._error_filters import ErrorFilters, TargetModel
from sim.channels import Channel

# Var(w2) T^4 / R, tuned on the scenarios at both rates: a slow camera sees a velocity that changes
# faster from picture to picture.
ACCELERATION_AT_30_HZ = 0.03
ACCELERATION_AT_5_HZ = 2.0
RHO = 0.95
"""Share of the acceleration that is left in the next picture, for intervals up to `SLOWEST`; chosen
by hand on the same scenarios."""
SLOWEST = 0.2
"""Frame interval [s] above which the share falls with the interval's square: otherwise the filter
would take each reversal for the beginning of a faster motion."""


@dataclass(frozen=True, slots=True)
class Config:
    """The estimator `error_kalman` has no settings."""

    needs = frozenset({Channel.SEEN})

    def build(self, rng: np.random.Generator) -> ErrorFilters:
        """Return the estimator, a Kalman filter of each feature's error that predicts the error for
        the time when the next command acts. It uses no random numbers.
        """
        return ErrorFilters(motion, predicts=True)


def motion(dt: float, jump: float = 0.0) -> TargetModel:
    """Return the linear model by which the target's motion changes the error of one feature from
    frame to frame. Its state is the error's velocity and acceleration that this motion causes;
    covariances are over the variance R of the error's measurement.

    Args:
        dt: Frame interval T [s].
        jump: Ratio Var(w1) T^2 / R, where w1 is the noise added to the velocity in each frame; 0:
            the velocity changes by the acceleration alone.
    """
    s = between(ACCELERATION_AT_30_HZ, ACCELERATION_AT_5_HZ, dt) / dt**4
    Q = np.diag([jump / dt**2, s])
    rho = RHO * min(1.0, (SLOWEST / dt) ** 2)
    P = np.diag([0.0, s / (1 - rho**2)])
    M = np.array([[1.0, dt], [0.0, rho]])
    return TargetModel(M, np.array([dt, dt**2 / 2]), Q, P)
