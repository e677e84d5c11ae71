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
"""Largest number of frames over which a level averages."""
FIRST = 5
"""Number of frames for which the given level counts at first."""
LARGEST_NIS = 9.0
"""A larger NIS of one innovation counts as this: a target that turns is not noise."""
SMALLEST_LEVEL = 0.01
"""The smallest level, over the given one."""
UNMEASURED = 1e12
"""Variance of what was not measured, over that of its innovation."""


@dataclass(frozen=True, slots=True)
class Model:
    """Linear model of the filter of one feature, with a state of n numbers."""

    F: Array
    """Transition per frame (n, n)."""
    B: Array
    """Effect of a known input on the state, per frame (n,)."""
    H: Array
    """Measurement row (n,)."""
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
        """Create filters with states of zero for a number of features."""
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
        """Replace the model, as for another frame interval."""
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
        """Predict the next frame.

        Args:
            u: Known input (k,).
            begun: True (k,) for features that have been measured; the others stay as they are.
        """
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
        """Expected next measurement (k,)."""
        return self.x @ self.model.H

    @property
    def S(self) -> Array:
        """Variance (k,) of the next innovation."""
        H = self.model.H
        return (self.covariance @ H) @ H + self.model.R

    def update(self, innovation: Array, measured: Flags) -> None:
        """Correct the states of the measured features by their innovations (k,)."""
        f = self._filter
        self._before = (self.x, self.covariance)
        f.x = self.x.reshape(-1, 1)
        # filterpy corrects all features at once: those without measurement get a huge variance.
        f.R = np.diag(np.where(measured, self.model.R, UNMEASURED * self.S))
        f.update(self.expected + np.where(measured, innovation, 0.0))
        self.x = f.x.reshape(self.x.shape)

    def forget(self, which: Flags) -> bool:
        """Undo the last correction of some features, and return True; return False if a prediction
        followed it.
        """
        if self._before is None:
            return False
        (x, P) = self._before
        self._before = None
        self.x = where(which, x, self.x)
        self.covariance = where(which, P, self.covariance)
        return True

    def _blocks(self) -> Array:
        """Return a view (k, n, k, n) of the joint covariance of all features' states."""
        shape = self.x.shape
        return self._filter.P.reshape(*shape, *shape)


def where(flags: Flags, a: Array, b: Array) -> Array:
    """Return an array with the rows of a where flags (k,) are True, and those of b elsewhere."""
    return np.where(flags.reshape(-1, *[1] * (a.ndim - 1)), a, b)


def blocks(each: Array, of_one: Array) -> Array:
    """Return the Kronecker product of two matrices: for each element of the first, a block that is
    this element times the second.
    """
    return np.kron(each, of_one).astype(np.float64)


@final
class Level:
    """Learns the variance (k,) of each feature's noise from innovations; older ones count less.

    After West and Harrison, Bayesian Forecasting and Dynamic Models, 2nd edition, Springer 1997,
    sections 4.5 and 10.8. A tracker's noise differs between targets, and between targets at rest
    and in motion.
    """

    def __init__(self, given: Array) -> None:
        """Start at given variances (k,)."""
        self.value = given.copy()
        self._least = SMALLEST_LEVEL * given
        self._frames = np.full(len(given), float(FIRST))

    def learn(self, ratio: Array, measured: Flags, but: Flags | None = None) -> Array:
        """Return the normalised innovation squared (k,), nan for features that were not measured,
        and then update the variances.

        Args:
            ratio: Squared innovations over the filter's variance S (k,).
            measured: True (k,) for features that were measured.
            but: True (k,) for features whose level stays; None: no such feature.
        """
        nis = np.where(measured, ratio / self.value, np.nan)
        # Recursive mean of the NIS with at most MEMORY frames; outliers are clipped.
        learns = measured if but is None else measured & ~but
        self._frames = np.minimum(self._frames + learns, MEMORY)
        change = np.where(learns, (np.minimum(nis, LARGEST_NIS) - 1) / self._frames, 0.0)
        self.value = np.maximum(self.value * (1 + change), self._least)
        return nis
