"""What the Kalman estimators share: the same small filter on each feature's plain difference."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import final

import numpy as np
from filterpy.kalman import KalmanFilter

from servo.estimators.difference import Difference
from sim.types import Array

FEATURES = 4


@dataclass(frozen=True, slots=True)
class Model:
    """The filter of one feature; its state begins with the estimated de/dt, which is measured."""

    F: Array
    """Transition per frame (n, n)."""
    Q: Array
    """Process noise per frame (n, n)."""
    R: float
    """Variance of the measurement."""
    P: Array
    """Covariance (n, n) after the first measurement."""


@final
class FeatureFilters:
    """One filter for each feature, as blocks of one; the model is made when the rate is known."""

    def __init__(self, model_at: Callable[[float], Model]) -> None:
        self._model_at = model_at
        self._difference = Difference()
        self._filter: KalmanFilter | None = None
        self._order = 1

    def update(self, error: Array, own: Array, dt: float) -> Array:
        """The estimate (4,). The first measurement starts the filter and is its own estimate."""
        measurable = self._difference.ready
        z = self._difference.update(error, own, dt)
        if not measurable:
            return self._estimate()
        if self._filter is None:
            self._filter = self._begin(z, self._model_at(dt))
        else:
            self._filter.predict()
            self._filter.update(z)
        return self._estimate()

    def skip(self) -> Array:
        """The last estimate (4,), kept; the next measurement needs two frames in a row."""
        self._difference.skip()
        return self._estimate()

    def _estimate(self) -> Array:
        if self._filter is None:
            return np.zeros(FEATURES)
        return self._filter.x[:: self._order, 0].copy()

    def _begin(self, z: Array, model: Model) -> KalmanFilter:
        self._order = len(model.F)
        each, first = np.eye(FEATURES), np.eye(self._order)[0]

        def blocks(of_one: Array) -> Array:
            return np.kron(each, of_one).astype(np.float64)

        f = KalmanFilter(dim_x=FEATURES * self._order, dim_z=FEATURES)
        f.F, f.H = blocks(model.F), blocks(first[None])
        f.Q, f.R, f.P = blocks(model.Q), model.R * each, blocks(model.P)
        f.x = np.kron(z, first)[:, None]
        return f
