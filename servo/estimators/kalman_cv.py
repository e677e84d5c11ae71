"""Kalman filter of a nearly constant target velocity (Teuliere, Marchand, Eck, equation 19; ViSP's
model).

For each feature by itself, with the plain difference z as measurement:

    x+ = x + nu    nu+ = rho nu + w
    F = [[1, 1], [0, rho]]    H = [1, 0]    Q = diag(0, sQ)    R = sR

A slow filter is worse than none where the target reverses, so the constants must fit the camera's
rate: those that are not given come from `tuned`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, final

import numpy as np
from annotated_types import Ge, Gt, Lt
from filterpy.kalman import KalmanFilter

from servo.estimators.difference import Difference
from sim.types import Array

RHO = 0.6
RATIO_AT_30_HZ, RATIO_AT_5_HZ = 0.03, 3.0
"""Tuned sQ / sR: a slow camera sees a faster changing velocity."""


def tuned(dt: float) -> float:
    """The ratio sQ / sR for a frame interval [s]: a power of it through the two tuned rates."""
    exponent = np.log(RATIO_AT_5_HZ / RATIO_AT_30_HZ) / np.log(30 / 5)
    return float(RATIO_AT_30_HZ * (30 * dt) ** exponent)


@dataclass(frozen=True, slots=True)
class Config:
    """Constants of the filter; only the ratio of the variances matters to the estimate."""

    rho: Annotated[float, Ge(0), Lt(1)] = RHO
    """Memory of the velocity's change from frame to frame."""
    state_variance: Annotated[float, Gt(0)] | None = None
    """sQ, per frame [(1/s)^2]; by default what suits the camera's rate."""
    measure_variance: Annotated[float, Gt(0)] = 1e-3
    """sR [(1/s)^2]."""

    def build(self, rng: np.random.Generator) -> KalmanCv:
        """The estimator; draws nothing."""
        return KalmanCv(self)


@final
class KalmanCv:
    """Four filters in one block matrix."""

    def __init__(self, config: Config) -> None:
        self._config = config
        self._difference = Difference()
        self._filter: KalmanFilter | None = None

    def update(self, error: Array, own: Array, dt: float) -> Array:
        """The estimate (4,). The first measurement starts the filter and is its own estimate."""
        measured = self._difference.ready
        z = self._difference.update(error, own, dt)
        if not measured:
            return self._estimate()
        if self._filter is None:
            self._filter = self._begin(z, dt)
        else:
            self._filter.predict()
            self._filter.update(z)
        return self._estimate()

    def skip(self) -> Array:
        """The last estimate (4,), kept."""
        self._difference.skip()
        return self._estimate()

    def _estimate(self) -> Array:
        return np.zeros(4) if self._filter is None else self._filter.x[0::2, 0].copy()

    def _begin(self, z: Array, dt: float) -> KalmanFilter:
        c = self._config
        sR = c.measure_variance
        sQ = tuned(dt) * sR if c.state_variance is None else c.state_variance
        each = np.eye(4)

        def block(of_one: Array) -> Array:
            return np.kron(each, of_one).astype(np.float64)

        f = KalmanFilter(dim_x=8, dim_z=4)
        f.F = block(np.array([[1.0, 1.0], [0.0, c.rho]]))
        f.H = block(np.array([[1.0, 0.0]]))
        f.Q = block(np.diag([0.0, sQ]))
        f.R = sR * each
        f.P = block(np.diag([sR, sQ / (1 - c.rho**2)]))
        f.x = np.kron(z, [1.0, 0.0])[:, None]
        return f
