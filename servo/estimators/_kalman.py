"""What the Kalman estimators share: the same small filter on each feature's plain difference."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Protocol, final

import numpy as np
from annotated_types import Ge, Le
from filterpy.kalman import KalmanFilter
from numpy.typing import NDArray

from servo.estimators.difference import Difference
from servo.types import Outlook, OwnMotion
from sim.geometry import inverse
from sim.types import Array

Variance = Annotated[float, Ge(1e-12), Le(1e12)]
Ratio = Annotated[float, Ge(1e-9), Le(1e9)]
"""Of a variance to the measurement's."""
Memory = Annotated[float, Ge(0), Le(0.999)]
"""Share of the velocity's change that is left after a frame: at 1 its variance has no limit."""
FEATURES = 4
NOISE = (1e-4, 1e-4, 7e-4, 1e-3)
"""Standard deviations of the features from frame to frame, relative to the goal's an, as `pf_ssd`
measures them: 0.03 px at f = 290 px, 0.07 % of size, 0.06 degrees. Estimates depend on ratios only;
innovations over their variance, and what is decided by them, on these too."""
VARIANCE = np.square(NOISE)


@dataclass(frozen=True, slots=True)
class Model:
    """The filter of one feature; its state begins with the estimated de/dt, which is measured."""

    F: Array
    """Transition per frame (n, n)."""
    Q: Array
    """Process noise per frame (n, n), for xn; noisier features have as much more."""
    R: float
    """Variance of the measurement of xn."""
    P: Array
    """Covariance (n, n) after the first measurement of xn."""


class Alarm(Protocol):
    """Tells when a feature's filter no longer fits."""

    def rings(self, normalised: Array) -> NDArray[np.bool_]:
        """For each feature (4,), from innovations over their standard deviations."""
        ...


def blocks(each: Array, of_one: Array) -> Array:
    """The Kronecker product: a block for each feature."""
    return np.kron(each, of_one).astype(np.float64)


def between(at_30_hz: float, at_5_hz: float, dt: float) -> float:
    """A constant for a frame interval [s]: a power of it through what was tuned at two rates."""
    return float(at_30_hz * (30 * dt) ** (np.log(at_5_hz / at_30_hz) / np.log(30 / 5)))


def difference_variance(dt: float) -> float:
    """Variance [(1/s)^2] of a difference of two measurements of xn, an interval [s] apart."""
    return float(2 * VARIANCE[0] / dt**2)


@final
class FeatureFilters:
    """One filter for each feature, as blocks of one; the model is made when the rate is known."""

    def __init__(self, model_at: Callable[[float], Model], alarm: Alarm | None = None) -> None:
        self._model_at, self._alarm = model_at, alarm
        self._difference = Difference()
        self._filter: KalmanFilter | None = None
        self._order = 1

    def update(self, error: Array, own: OwnMotion, dt: float) -> Outlook:
        """The first measurement starts the filter and is its own estimate."""
        measurable = self._difference.ready
        z = self._difference.measure(error, own.past, dt)
        if not measurable:
            return Outlook.plain(error, self._estimate())
        if self._filter is None:
            self._filter = self._begin(z, self._model_at(dt))
            return Outlook.plain(error, self._estimate())
        self._filter.predict()
        self._filter.update(z)
        innovation, variance = self._filter.y[:, 0].copy(), self._filter.S.diagonal()
        if self._alarm is not None:
            jumped = self._alarm.rings(innovation / np.sqrt(variance))
            self._restart(self._filter, jumped, z, self._model_at(dt))
        return Outlook(error, self._estimate(), innovation, innovation**2 / variance)

    def skip(self, own: OwnMotion, dt: float) -> Outlook:
        """The last estimate, kept; the next measurement needs two frames in a row."""
        self._difference.forget()
        return Outlook.plain(np.zeros(FEATURES), self._estimate())

    def _estimate(self) -> Array:
        if self._filter is None:
            return np.zeros(FEATURES)
        return self._filter.x[:: self._order, 0].copy()

    def _restart(self, f: KalmanFilter, which: NDArray[np.bool_], z: Array, model: Model) -> None:
        """Forget what was before for some of the features: the measurement is their estimate."""
        order = self._order
        for i in np.flatnonzero(which):
            block = slice(i * order, (i + 1) * order)
            f.x[block, 0] = z[i] * np.eye(order)[0]
            f.P[block, block] = model.P * VARIANCE[i] / VARIANCE[0]

    def _begin(self, z: Array, model: Model) -> KalmanFilter:
        each, noisy = np.eye(FEATURES), np.diag(VARIANCE / VARIANCE[0])
        order = self._order = len(model.F)
        first = np.eye(order)[0]
        f = KalmanFilter(dim_x=FEATURES * order, dim_z=FEATURES)
        f.inv = inverse  # pyright: ignore[reportAttributeAccessIssue]  (it is there to be set)
        f.F, f.H = blocks(each, model.F), blocks(each, first[None])
        f.Q, f.R, f.P = blocks(noisy, model.Q), model.R * noisy, blocks(noisy, model.P)
        f.x = blocks(z, first)[:, None]
        return f
