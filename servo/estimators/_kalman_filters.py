"""Kalman filters of k features, run side by side as one, and the noise level of each feature, which
is learned.

Covariances are over a variance of each feature, its level. Gains depend on ratios only, so a level
changes no estimate; it decides how improbable an innovation is.
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
    """Matrices of the Kalman filter of one feature, whose state has n numbers."""

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
    """Initial covariance (n, n) of the state."""


@final
class KalmanFilters:
    """Kalman filters of k independent features with one model: states x (k, n) and covariances (k,
    n, n), computed as the diagonal blocks of one large filter.
    """

    def __init__(self, model: Model, count: int) -> None:
        """Create `count` filters with states of zero, and the model's initial covariance."""
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
        """Replace the model's matrices, as for another frame interval; states and covariances
        stay.
        """
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
        """Predict states and covariances for the next frame.

        Args:
            u: Known input (k,), multiplied by the model's B.
            begun: True (k,) for features that have been measured; states and covariances of the
                others stay.
        """
        f = self._filter
        x = self.x
        P = None if begun.all() else self.covariance
        self._before = None
        f.x = x.reshape(-1, 1)
        f.predict(u[:, None])
        self.x = f.x.reshape(x.shape)
        if P is not None:
            self.x = where(begun, self.x, x)
            self.covariance = where(begun, self.covariance, P)

    @property
    def covariance(self) -> Array:
        """Covariances (k, n, n) of the states, each divided by the feature's level of variance."""
        return self._blocks()[self._all, :, self._all]

    @covariance.setter
    def covariance(self, blocks: Array) -> None:
        self._blocks()[self._all, :, self._all] = blocks

    @property
    def expected(self) -> Array:
        """Expected next measurement H x of each feature (k,)."""
        return self.x @ self.model.H

    @property
    def S(self) -> Array:
        """Variance H P H' + R of the next innovation of each feature (k,), divided by the feature's
        level of variance.
        """
        H = self.model.H
        return (self.covariance @ H) @ H + self.model.R

    def update(self, innovation: Array, measured: Flags) -> None:
        """Correct the states of the features that are marked as measured (k,) by their innovations
        (k,).
        """
        f = self._filter
        self._before = (self.x, self.covariance)
        f.x = self.x.reshape(-1, 1)
        # filterpy corrects all features at once: those without measurement get a huge variance.
        f.R = self.model.R * self._each
        if not measured.all():
            f.R[~measured, ~measured] = UNMEASURED * self.S[~measured]
        f.update(self.expected + np.where(measured, innovation, 0.0))
        self.x = f.x.reshape(self.x.shape)

    def forget(self, which: Flags) -> bool:
        """Undo the last correction of the features that are marked (k,), and return True. If a
        prediction followed it, or it was undone already, change nothing and return False.
        """
        if self._before is None:
            return False
        (x, P) = self._before
        self._before = None
        self.x = where(which, x, self.x)
        self.covariance = where(which, P, self.covariance)
        return True

    def _blocks(self) -> Array:
        """Return the joint covariance of all features' states as a writable view (k, n, k, n)."""
        shape = self.x.shape
        return self._filter.P.reshape(*shape, *shape)


def where(flags: Flags, a: Array, b: Array) -> Array:
    """Return an array of the shape of a and b (k, ...): its rows are those of a where flags (k,)
    are True, else those of b.
    """
    return np.where(flags.reshape(-1, *[1] * (a.ndim - 1)), a, b)


def blocks(each: Array, of_one: Array) -> Array:
    """Return the Kronecker product of two matrices: each element of `each` becomes a block, the
    element times `of_one`.
    """
    return np.kron(each, of_one).astype(np.float64)


@final
class Level:
    """Learns the variance (k,) of each feature's noise from innovations: a running mean over at
    most 60 frames, in which older innovations count less.

    After West and Harrison, Bayesian Forecasting and Dynamic Models, 2nd edition, Springer 1997,
    sections 4.5 and 10.8. A tracker's noise differs between targets, and between targets at rest
    and in motion.
    """

    def __init__(self, given: Array) -> None:
        """Start with given variances (k,), which count as much as 5 frames at first."""
        self.value = given.copy()
        self._least = SMALLEST_LEVEL * given
        self._frames = np.full(len(given), float(FIRST))

    def learn(self, ratio: Array, measured: Flags, but: Flags | None = None) -> Array:
        """Return the normalised innovation squared (k,) with the variances as they are, nan for
        features that were not measured; then update the variances.

        Args:
            ratio: Squared innovations over the filter's variance S (k,).
            measured: True (k,) for features that were measured.
            but: True (k,) for measured features whose variance is not updated; None: no such
                feature.
        """
        nis = np.where(measured, ratio / self.value, np.nan)
        # Recursive mean of the NIS with at most MEMORY frames; outliers are clipped.
        learns = measured if but is None else measured & ~but
        self._frames = np.minimum(self._frames + learns, MEMORY)
        change = np.where(learns, (np.minimum(nis, LARGEST_NIS) - 1) / self._frames, 0.0)
        self.value = np.maximum(self.value * (1 + change), self._least)
        return nis
