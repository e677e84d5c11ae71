"""Interacting multiple models (Blom, Bar-Shalom 1988) of the error: a target drives smoothly or
manoeuvres.

Both are filters of error_kalman, which see the measured camera motion and predict over the delay;
the second one lets the velocity jump. How likely each is now decides how much it counts.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, final

import numpy as np
from annotated_types import Ge, Le
from filterpy.kalman import IMMEstimator

from servo.estimators import _error_filter
from servo.estimators._kalman import Ratio
from servo.parts import FeatureSet
from servo.types import OwnMotion, Prediction
from sim.types import Array


@dataclass(frozen=True, slots=True)
class Config(_error_filter.ErrorSettings):
    """Constants of the smooth model, and the noise of the manoeuvring one."""

    jump: Ratio = 1.0
    """Noise of the velocity of a manoeuvring target over the measurement's, per frame."""
    stay: Annotated[float, Ge(0.5), Le(0.9999)] = 0.95
    """Probability that a target drives on as it does, from frame to frame."""

    def build(self, rng: np.random.Generator) -> Imm:
        """The estimator; draws nothing."""
        return Imm(self)


@final
class Imm:
    """Two models for each feature, mixed for each by itself."""

    def __init__(self, config: Config) -> None:
        self._config = config

    def start(self, features: FeatureSet) -> None:
        """Begin with these features."""
        self._features = features
        self._mixtures: list[IMMEstimator] = []

    def update(self, error: Array, own: OwnMotion, dt: float) -> Prediction:
        """The first error starts the filters."""
        c = self._config
        if not self._mixtures:
            self._mixtures = [self._begin(i, error[i], dt) for i in range(len(error))]
            return _error_filter.unseen(self._states(), own, c.rho, dt)
        expected = np.empty_like(error)
        innovation, nis = np.zeros_like(error), np.zeros_like(error)
        for i, mixture in enumerate(self._mixtures):
            mixture.predict(own.past[i : i + 1, None])
            expected[i] = mixture.x_prior[0, 0]
        measured = expected + self._features.error(error, expected)
        for i, mixture in enumerate(self._mixtures):
            mixture.update(measured[i])
            y = np.array([f.y[0, 0] for f in mixture.filters])
            S = np.array([f.S[0, 0] for f in mixture.filters])
            innovation[i], nis[i] = mixture.mu @ y, mixture.mu @ (y**2 / S)
        ahead = _error_filter.look_ahead(self._states(), own, c.rho, dt)
        return Prediction(*ahead, innovation, nis)

    def skip(self, own: OwnMotion, dt: float) -> Prediction:
        """The prediction."""
        if not self._mixtures:
            none = np.zeros(len(self._features.names))
            return Prediction.unmeasured(none, none)
        for i, mixture in enumerate(self._mixtures):
            mixture.predict(own.past[i : i + 1, None])
            mixture.x = mixture.x_prior.copy()
        return _error_filter.unseen(self._states(), own, self._config.rho, dt)

    def _states(self) -> Array:
        return np.array([mixture.x[:, 0] for mixture in self._mixtures])

    def _begin(self, feature: int, error: float, dt: float) -> IMMEstimator:
        c = self._config
        smooth = c.noise(dt)
        variance = np.square(self._features.noise[feature : feature + 1])
        filters = [
            _error_filter.error_filter(variance, noise, c.rho, dt)
            for noise in (smooth, replace(smooth, velocity=c.jump))
        ]
        for f in filters:
            f.x = np.array([[error], [0.0], [0.0]])
        go = 1 - c.stay
        return IMMEstimator(filters, [0.5, 0.5], np.array([[c.stay, go], [go, c.stay]]))
