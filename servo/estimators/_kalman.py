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
from servo.parts import FeatureSet
from servo.types import OwnMotion, Prediction
from sim.geometry import inverse
from sim.types import Array

Variance = Annotated[float, Ge(1e-12), Le(1e12)]
Ratio = Annotated[float, Ge(1e-9), Le(1e9)]
"""Of a variance to the measurement's."""
Memory = Annotated[float, Ge(0), Le(0.999)]
"""Share of the velocity's change that is left after a frame: at 1 its variance has no limit."""


@dataclass(frozen=True, slots=True)
class Model:
    """The filter of one feature; its state begins with the estimated de/dt, which is measured."""

    F: Array
    """Transition per frame (n, n)."""
    Q: Array
    """Process noise per frame (n, n), of the first feature; that of the others is scaled by their
    own variance."""
    R: float
    """Variance of the first feature's measurement."""
    P: Array
    """Covariance (n, n) after the first feature's first measurement."""


class JumpTest(Protocol):
    """Decides when a feature's filter no longer fits."""

    def jumped(self, normalised: Array) -> NDArray[np.bool_]:
        """For each feature (k,), from innovations over their standard deviations."""
        ...


def blocks(each: Array, of_one: Array) -> Array:
    """The Kronecker product: a block for each feature."""
    return np.kron(each, of_one).astype(np.float64)


def between(at_30_hz: float, at_5_hz: float, dt: float) -> float:
    """A constant for a frame interval [s]: a power of it through what was tuned at two rates."""
    return float(at_30_hz * (30 * dt) ** (np.log(at_5_hz / at_30_hz) / np.log(30 / 5)))


def difference_variance(variance: float, dt: float) -> float:
    """Variance of the difference of two measurements of this variance, an interval [s] apart, over
    that interval [1/s^2].
    """
    return float(2 * variance / dt**2)


@final
class FeatureFilters:
    """One filter for each feature, as blocks of one; the model is made when the rate is known."""

    def __init__(
        self, model_at: Callable[[float, float], Model], test: JumpTest | None = None
    ) -> None:
        """Filters that begin with the first measurement.

        Args:
            model_at: The model at a frame interval [s], for features whose first one is measured
                with this variance.
            test: Finds features whose filter is to begin anew.
        """
        self._model_at, self._test = model_at, test

    def start(self, features: FeatureSet) -> None:
        """Begin with these features."""
        self._variance = np.square(features.noise)
        self._difference = Difference(features)
        self._filter: KalmanFilter | None = None
        self._order = 1

    def update(self, error: Array, own: OwnMotion, dt: float) -> Prediction:
        """The first measurement starts the filter and is its own estimate."""
        measurable = self._difference.ready
        z = self._difference.measure(error, own.past, dt)
        if not measurable:
            return Prediction.unmeasured(error, self._estimate())
        if self._filter is None:
            self._filter = self._begin(z, self._model(dt))
            return Prediction.unmeasured(error, self._estimate())
        self._filter.predict()
        self._filter.update(z)
        innovation, variance = self._filter.y[:, 0].copy(), self._filter.S.diagonal()
        if self._test is not None:
            jumped = self._test.jumped(innovation / np.sqrt(variance))
            self._restart(self._filter, jumped, z, self._model(dt))
        return Prediction(error, self._estimate(), innovation, innovation**2 / variance)

    def skip(self, own: OwnMotion, dt: float) -> Prediction:
        """The last estimate, kept; the next measurement needs two frames in a row."""
        self._difference.forget()
        return Prediction.unmeasured(np.zeros_like(self._variance), self._estimate())

    def _model(self, dt: float) -> Model:
        return self._model_at(dt, self._variance[0])

    def _estimate(self) -> Array:
        if self._filter is None:
            return np.zeros_like(self._variance)
        return self._filter.x[:: self._order, 0].copy()

    def _restart(self, f: KalmanFilter, which: NDArray[np.bool_], z: Array, model: Model) -> None:
        """Forget what was before for some of the features: the measurement is their estimate."""
        order = self._order
        for i in np.flatnonzero(which):
            block = slice(i * order, (i + 1) * order)
            f.x[block, 0] = z[i] * np.eye(order)[0]
            f.P[block, block] = model.P * self._variance[i] / self._variance[0]

    def _begin(self, z: Array, model: Model) -> KalmanFilter:
        count = len(self._variance)
        each, noisy = np.eye(count), np.diag(self._variance / self._variance[0])
        order = self._order = len(model.F)
        first = np.eye(order)[0]
        f = KalmanFilter(dim_x=count * order, dim_z=count)
        f.inv = inverse  # pyright: ignore[reportAttributeAccessIssue]  (it is there to be set)
        f.F, f.H = blocks(each, model.F), blocks(each, first[None])
        f.Q, f.R, f.P = blocks(noisy, model.Q), model.R * noisy, blocks(noisy, model.P)
        f.x = blocks(z, first)[:, None]
        return f
