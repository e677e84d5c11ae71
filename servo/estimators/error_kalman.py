"""Kalman filter on the error itself, with the measured camera motion as known input.

A difference of two frames doubles the noise and is half a frame old; this filter has neither fault.
It knows the commands that are under way, so it predicts the error over the delay, and goes on
predicting where the target is not seen.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np
from filterpy.kalman import KalmanFilter

from servo.estimators import _error_filter
from servo.parts import FeatureSet
from servo.types import OwnMotion, Prediction
from sim.types import Array


@dataclass(frozen=True, slots=True)
class Config(_error_filter.ErrorSettings):
    """Constants of the filter."""

    def build(self, rng: np.random.Generator) -> ErrorKalman:
        """The estimator; draws nothing."""
        return ErrorKalman(self)


@final
class ErrorKalman:
    """One filter for all features."""

    def __init__(self, config: Config) -> None:
        self._config = config

    def start(self, features: FeatureSet) -> None:
        """Begin with these features."""
        self._features = features
        self._filter: KalmanFilter | None = None

    def update(self, error: Array, own: OwnMotion, dt: float) -> Prediction:
        """The first error starts the filter."""
        c = self._config
        if self._filter is None:
            self._filter = f = _error_filter.error_filter(
                np.square(self._features.noise), c.noise(dt), c.rho, dt
            )
            f.x = np.kron(error, [1.0, 0.0, 0.0])[:, None]
            return _error_filter.unseen(_states(f), own, c.rho, dt)
        f = self._filter
        f.predict(own.past[:, None])
        expected = f.x[:: _error_filter.ORDER, 0]
        gap = self._features.error(error, expected)
        f.update(expected + gap)
        ahead = _error_filter.look_ahead(_states(f), own, c.rho, dt)
        return Prediction(*ahead, gap, gap**2 / np.diag(f.S))

    def skip(self, own: OwnMotion, dt: float) -> Prediction:
        """The prediction."""
        if self._filter is None:
            none = np.zeros(len(self._features.names))
            return Prediction.unmeasured(none, none)
        self._filter.predict(own.past[:, None])
        return _error_filter.unseen(_states(self._filter), own, self._config.rho, dt)


def _states(f: KalmanFilter) -> Array:
    return f.x.reshape(-1, _error_filter.ORDER).copy()
