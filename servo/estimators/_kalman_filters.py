"""Small Kalman filters side by side, one for each feature, and the noise level that they learn.

Covariances are relative to a variance of each feature, its level. Gains depend on ratios only, so a
level changes no estimate; it decides how unlikely an innovation is.
"""

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from servo.estimators._filterpy import kalman_filter
from sim.geometry import inverse
from sim.types import Array

Flags = NDArray[np.bool_]
# The constants of a level were chosen by hand so that the NIS of `line`, `sine` and `wander` stays
# between 0.5 and 2 (tests/test_estimation.py).
MEMORY = 60
"""Frames over which a level is learned."""
FIRST = 5
"""Frames that the given level counts for at first."""
LARGEST_NIS = 9.0
"""A larger NIS of one innovation counts as this: a target that turns is not noise."""
SMALLEST_LEVEL = 0.01
"""The smallest level, over the given one."""
UNMEASURED = 1e12
"""Variance of what was not measured, over that of its innovation."""


@dataclass(frozen=True, slots=True)
class Model:
    """The filter of one feature; its state has n numbers."""

    F: Array
    """Transition per frame (n, n)."""
    B: Array
    """What a known input adds per frame (n,)."""
    H: Array
    """The measurement (n,)."""
    Q: Array
    """Process noise per frame (n, n)."""
    R: float
    """Variance of the measurement's white noise."""
    P: Array
    """Covariance (n, n) after the first measurement."""


@final
class KalmanFilters:
    """States x (k, n) and covariances (k, n, n) of k features, as the blocks of one filter."""

    def __init__(self, model: Model, count: int) -> None:
        """Begin with states of zero."""
        self._all = np.arange(count)
        self._each = np.eye(count)
        self._filter = f = kalman_filter()(dim_x=count * len(model.H), dim_z=count, dim_u=count)
        f.inv = inverse  # pyright: ignore[reportAttributeAccessIssue]  (it is there to be set)
        f.H = blocks(self._each, model.H[None])
        f.P = blocks(self._each, model.P)
        self.x = np.zeros((count, len(model.H)))
        self._before: tuple[Array, Array] | None = None
        self._take(model)

    def use(self, model: Model) -> None:
        """Go on with the model of another interval."""
        if model is not self.model:
            self._take(model)

    def _take(self, model: Model) -> None:
        self.model = model
        f = self._filter
        each = self._each
        f.F = blocks(each, model.F)
        f.Q = blocks(each, model.Q)
        f.B = blocks(each, model.B[:, None])  # pyright: ignore[reportAttributeAccessIssue]

    def predict(self, u: Array, begun: Flags) -> None:
        """Go on by a frame, with a known input (k,), where a feature has been measured before."""
        f = self._filter
        x = self.x
        P = self.covariance
        self._before = None
        f.x = x.reshape(-1, 1)
        f.predict(u[:, None])
        self.x = f.x.reshape(x.shape)
        if not begun.all():
            self.x = where(begun, self.x, x)
            self.covariance = where(begun, self.covariance, P)

    @property
    def covariance(self) -> Array:
        """Covariances (k, n, n)."""
        return self._blocks()[self._all, :, self._all]

    @covariance.setter
    def covariance(self, blocks: Array) -> None:
        self._blocks()[self._all, :, self._all] = blocks

    @property
    def expected(self) -> Array:
        """What the next measurement should be (k,)."""
        return self.x @ self.model.H

    @property
    def S(self) -> Array:
        """Variance (k,) of the next innovation."""
        H = self.model.H
        return (self.covariance @ H) @ H + self.model.R

    def update(self, innovation: Array, measured: Flags) -> None:
        """Correct the features that were measured, by their innovations (k,)."""
        f = self._filter
        self._before = (self.x, self.covariance)
        f.x = self.x.reshape(-1, 1)
        f.R = np.diag(np.where(measured, self.model.R, UNMEASURED * self.S))
        f.update(self.expected + np.where(measured, innovation, 0.0))
        self.x = f.x.reshape(self.x.shape)

    def forget(self, which: Flags) -> bool:
        """Take back the correction of some features (k,), if it came last; whether it did."""
        if self._before is None:
            return False
        (x, P) = self._before
        self._before = None
        self.x = where(which, x, self.x)
        self.covariance = where(which, P, self.covariance)
        return True

    def _blocks(self) -> Array:
        """Return the filter's covariance (k, n, k, n); writing to it changes the filter's."""
        shape = self.x.shape
        return self._filter.P.reshape(*shape, *shape)


def where(flags: Flags, a: Array, b: Array) -> Array:
    """Return the rows of a where the flags (k,) are set, else those of b."""
    return np.where(flags.reshape(-1, *[1] * (a.ndim - 1)), a, b)


def blocks(each: Array, of_one: Array) -> Array:
    """Return the Kronecker product: a block for each feature."""
    return np.kron(each, of_one).astype(np.float64)


@final
class Level:
    """Variance (k,) of each feature's noise, learned from innovations, older ones discounted.

    After West and Harrison, Bayesian Forecasting and Dynamic Models, 2nd edition, Springer 1997,
    sections 4.5 and 10.8: a tracker's noise differs between targets, and between one that rests and
    one that moves over a ground.
    """

    def __init__(self, given: Array) -> None:
        """Begin with states of zero."""
        self.value = given.copy()
        self._least = SMALLEST_LEVEL * given
        self._frames = np.full(len(given), float(FIRST))

    def learn(self, ratio: Array, measured: Flags, but: Flags | None = None) -> Array:
        """Return the NIS (k,) of innovations whose squares over the filter's variance S are given;
        nan where nothing was measured. The level changes afterwards, except for those in `but`.
        """
        nis = np.where(measured, ratio / self.value, np.nan)
        learns = measured if but is None else measured & ~but
        self._frames = np.minimum(self._frames + learns, MEMORY)
        change = np.where(learns, (np.minimum(nis, LARGEST_NIS) - 1) / self._frames, 0.0)
        self.value = np.maximum(self.value * (1 + change), self._least)
        return nis
