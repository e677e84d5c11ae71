"""Kalman filters that measure differences of the error, as ViSP's do, and constants that are
interpolated between the frame rates 30 Hz and 5 Hz.
"""

from collections.abc import Callable
from functools import cache
from typing import Annotated, Literal, final

import numpy as np
from annotated_types import Ge, Le

from servo.estimators._kalman_filters import KalmanFilters, Model
from servo.parts import FeatureSet
from servo.sight.difference import Difference
from servo.types import OwnMotion, Prediction
from sim.types import Array

Ratio = Annotated[float, Ge(1e-9), Le(1e9)]
"""Ratio of a variance to the measurement's."""
Memory = Annotated[float, Ge(0), Le(0.999)]
"""Share of the velocity's change that is left after a frame: at 1 its variance has no limit."""
Noise = Literal["position", "difference"]


def between(at_30_hz: float, at_5_hz: float, dt: float) -> float:
    """Return a constant for a frame interval dt [s]: a power law of dt through the values that were
    tuned at 30 Hz and at 5 Hz.
    """
    return float(at_30_hz * (30 * dt) ** (np.log(at_5_hz / at_30_hz) / np.log(30 / 5)))


def difference_variance(variance: float, dt: float) -> float:
    """Return the variance 2 variance / dt^2 of (z2 - z1) / dt, for two independent measurements
    with this variance, dt [s] apart.
    """
    return float(2 * variance / dt**2)


@final
class DifferenceFilters:
    """Estimator of de/dt of the target's own motion, by a Kalman filter for each feature that
    measures differences of the error. The filters assume white noise, although the noise of
    successive differences is correlated.
    """

    def __init__(self, model_at: Callable[[float, float], Model]) -> None:
        """Create the filters; that of a feature starts with the feature's first difference.

        Args:
            model_at: Function that returns the filter model of the first feature from the frame
                interval [s] and the variance of its noise; the covariances of the other features
                are scaled by their own noise.
        """
        self._model_at = model_at

    def start(self, features: FeatureSet) -> None:
        """Begin a run with a feature set: no feature has been measured yet."""
        variance = np.square(features.noise)
        self._first = float(variance[0])
        self._relative = variance / variance[0]
        self._difference = Difference(features)
        self._model = cache(lambda dt: self._model_at(dt, self._first))
        self._begun = np.zeros(len(variance), dtype=bool)
        self._filters: KalmanFilters | None = None

    def update(self, error: Array, own: OwnMotion, dt: float) -> Prediction:
        """Return the measured error (0 where it is nan), and the filtered de/dt of the target's own
        motion, after a picture.

        Args:
            error: Feature error (k,) over the features' scales; nan for features that were not
                measured.
            own: The part of de/dt that the camera's own motion causes.
            dt: Time since the last picture [s].
        """
        if self._filters is None:
            self._filters = KalmanFilters(self._model(dt), len(error))
        self._filters.use(self._model(dt))
        f = self._filters
        shown = np.where(np.isfinite(error), error, 0.0)
        z, fresh = self._difference.measure(error, own.past, dt)
        first = fresh & ~self._begun
        measured = fresh & self._begun
        # Differences have no known input: the camera's part is already taken out.
        f.predict(np.zeros(len(error)), self._begun)
        y = z - f.expected
        nis = y**2 / (f.S * self._relative)
        f.update(y, measured)
        f.x[first, 0] = z[first]  # the first measurement is its own estimate
        self._begun |= fresh
        y, nis = (np.where(measured, values, np.nan) for values in (y, nis))
        return Prediction(shown, f.x[:, 0].copy(), y * dt, nis)

    def skip(self, own: OwnMotion, dt: float) -> Prediction:
        """Return an error of zero and the predicted de/dt, for a frame in which the target was not
        seen; the next difference then needs two successive frames with the target.
        """
        self._difference.forget()
        zero = np.zeros(len(self._begun))
        if self._filters is None:
            return Prediction.unmeasured(zero, zero)
        self._filters.use(self._model(dt))
        self._filters.predict(zero, self._begun)
        return Prediction.unmeasured(zero, self._filters.x[:, 0].copy())
