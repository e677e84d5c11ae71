"""What the filters on the error itself share: its model, with the camera's motion as known input.

For each feature, with T the frame interval and u the de/dt that the camera causes:

    e+ = e + T (u + d) + T^2/2 a    d+ = d + T a + w1    a+ = rho a + w2    measured: e
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Le
from filterpy.kalman import KalmanFilter

from servo.estimators._kalman import Ratio, between, blocks
from servo.types import OwnMotion, Prediction
from sim.types import Array

ORDER = 3
AT_30_HZ, AT_5_HZ = 0.03, 3.0
"""Tuned noise of the acceleration: a slow camera sees a faster changing velocity."""
DIFFUSE = 100.0
"""Standard deviation of the first velocity, in the measurement's per frame."""


@dataclass(frozen=True, slots=True)
class Noise:
    """Process noise of one feature over the measurement's, per frame."""

    velocity: float
    """Var(w1) T^2 / R."""
    acceleration: float
    """Var(w2) T^4 / R."""


@dataclass(frozen=True, slots=True)
class ErrorSettings:
    """Constants of the filter."""

    rho: Annotated[float, Ge(0), Le(1)] = 0.95
    """Memory of the acceleration from frame to frame."""
    acceleration: Ratio | None = None
    """Noise of the acceleration over the measurement's, per frame: Var(w2) T^4 / R; by default
    what suits the camera's rate."""
    velocity: Annotated[float, Ge(0), Le(1e9)] = 0.0
    """Noise of the velocity over the measurement's, per frame: Var(w1) T^2 / R."""

    def noise(self, dt: float) -> Noise:
        """The process noise at a frame interval [s]."""
        return Noise(self.velocity, self.acceleration or between(AT_30_HZ, AT_5_HZ, dt))


def transition(dt: float, rho: float) -> Array:
    """F (3, 3) of (e, d, a)."""
    return np.array([[1.0, dt, dt**2 / 2], [0.0, 1.0, dt], [0.0, 0.0, rho]])


def process_noise(noise: Noise, dt: float) -> Array:
    """Q (3, 3) of (e, d, a), for a measurement of variance 1."""
    return np.diag([0.0, noise.velocity / dt**2, noise.acceleration / dt**4])


def error_filter(variance: Array, noise: Noise, rho: float, dt: float) -> KalmanFilter:
    """One filter over the errors of several features, each a block of three, at rest at zero.

    Args:
        variance: Of each feature's measurement (n,).
        noise: Of the process.
        rho: Memory of the acceleration.
        dt: Frame interval [s].
    """
    n, each, R = len(variance), np.eye(len(variance)), np.diag(variance)
    f = KalmanFilter(dim_x=ORDER * n, dim_z=n, dim_u=n)
    f.F = blocks(each, transition(dt, rho))
    f.B = blocks(each, np.array([[dt], [0.0], [0.0]]))  # pyright: ignore[reportAttributeAccessIssue]
    f.H = blocks(each, np.eye(ORDER)[:1])
    f.Q, f.R = blocks(R, process_noise(noise, dt)), R
    f.P = blocks(R, np.diag([1.0, (DIFFUSE / dt) ** 2, noise.acceleration / dt**4]))
    return f


def look_ahead(states: Array, own: OwnMotion, rho: float, dt: float) -> tuple[Array, Array]:
    """Error (4,) when the command asked for now begins to act, and the target's mean motion (4,)
    while it does, from states (4, 3) as of the frame.
    """
    F, x = transition(dt, rho), states
    for coming in own.coming:
        x = x @ F.T
        x[:, 0] += dt * coming
    return x[:, 0], x[:, 1] + dt / 2 * x[:, 2]


def unseen(states: Array, own: OwnMotion, rho: float, dt: float) -> Prediction:
    """The prediction where nothing was measured."""
    return Prediction.unmeasured(*look_ahead(states, own, rho, dt))
