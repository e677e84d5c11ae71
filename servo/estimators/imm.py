"""Estimator by interacting multiple models (IMM) of the error: the target moves smoothly or
manoeuvres.

Blom and Bar-Shalom, The Interacting Multiple Model Algorithm for Systems with Markovian Switching
Coefficients, IEEE Transactions on Automatic Control 33(8), 1988. Both models are those of
error_kalman; the second one lets the velocity jump. Each is weighted by its current probability.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import final

import numpy as np

from servo.estimators._error_filters import TargetModel, look_ahead, models, stated
from servo.estimators._kalman_filters import KalmanFilters, Level, where
from servo.estimators.error_kalman import motion
from servo.parts import FeatureSet
from servo.types import OwnMotion, Prediction
from sim.channels import Channel, View
from sim.types import Array

# Both were chosen by hand on the scenarios whose target reverses or weaves.
JUMP = 0.3
"""Ratio Var(w1) T^2 / R of a manoeuvring target, with w1 the change of its velocity from one frame
to the next (`error_kalman.motion`)."""
STAY = 0.95
"""Probability that a target keeps its model from one frame to the next."""
IMPOSSIBLE = 1e-300
"""Smallest likelihood of a model, so that the sum of both is never zero."""


@dataclass(frozen=True, slots=True)
class Config:
    """The estimator `imm` has no settings."""

    needs = frozenset({Channel.SEEN})

    def build(self, rng: np.random.Generator) -> "Imm":
        """Return the estimator, which uses no random numbers."""
        return Imm((motion, partial(motion, jump=JUMP)))


@final
class Imm:
    """Estimator with two Kalman filters of the error of each feature, one for smooth motion of the
    target and one for manoeuvres. Their results are weighted by the probabilities of the two
    models.
    """

    def __init__(self, motions: tuple[Callable[[float], TargetModel], ...]) -> None:
        """Create the estimator.

        Args:
            motions: Two functions that return the model of the target's motion from a frame
                interval [s], for smooth motion and for manoeuvres.
        """
        self._model_at = tuple(models(each) for each in motions)
        go = 1 - STAY
        self._switch = np.array([[STAY, go], [go, STAY]])

    def start(self, features: FeatureSet) -> None:
        """Begin a run with a feature set: for each feature both models are equally probable, and no
        feature has been measured yet.
        """
        k = len(features.names)
        self._features = features
        self._level = Level(np.square(features.noise))
        self._begun = np.zeros(k, dtype=bool)
        self._filters: tuple[KalmanFilters, ...] = ()
        self._mu = np.full((2, k), 0.5)

    def update(self, error: Array, own: OwnMotion, dt: float) -> Prediction:
        """Mix, predict and correct the filters after a picture, and return their prediction: the
        feature error at the time when the next command acts, the rate de/dt (k,) [1/s] from the
        target's own motion, innovations, and variances of both. The first measured error of a
        feature starts its filters.

        Args:
            error: Feature error (k,) over the features' scales; nan for features that were not
                measured.
            own: The rate of this error that the camera's own motion causes, since the last picture
                and until the next command acts.
            dt: Time since the last picture [s].
        """
        if not self._filters:
            self._filters = tuple(KalmanFilters(at(dt), len(error)) for at in self._model_at)
        seen = np.isfinite(error)
        self._corrected = measured = seen & self._begun
        self._mix_and_predict(own, dt)
        each = np.array([f.expected for f in self._filters])
        expected = (self._mu * each).sum(axis=0)
        # Differences of angles are wrapped around the mixed expectation, common to both models.
        z = expected + self._features.error(np.where(seen, error, expected), expected)
        y = z - each
        S = np.array([f.S for f in self._filters])
        spread = (self._mu * (S + (each - expected) ** 2 / self._level.value)).sum(axis=0)
        level = self._level.value
        nis = self._level.learn((z - expected) ** 2 / spread, measured)
        # Bayes: prior probability times the Gaussian likelihood of each model's innovation.
        fits = self._mu * np.exp(-(y**2) / (2 * S * level)) / np.sqrt(S) + IMPOSSIBLE
        self._mixed = self._mu
        self._mu = np.where(measured, fits / fits.sum(axis=0), self._mu)
        for f, gap in zip(self._filters, y, strict=True):
            f.update(gap, seen)
        self._begun |= seen
        innovation = np.where(measured, z - expected, np.nan)
        error, motion, variance = self._ahead(own)
        return Prediction(error, motion, innovation, nis, variance)

    def see(self, view: View) -> None:
        """Undo the correction by the previous picture, also of the models' probabilities, if the
        target is not seen in this one: it was probably half hidden before. The first measurement of
        a feature is kept.

        Args:
            view: Data of the picture; `view.seen` is False if the target is not seen.
        """
        if view.seen is not False:
            return
        taken_back = [f.forget(self._corrected) for f in self._filters]
        if any(taken_back):
            self._mu = np.where(self._corrected, self._mixed, self._mu)

    def skip(self, own: OwnMotion, dt: float) -> Prediction:
        """Return the feature error and its rate de/dt (k,) from the target's own motion [1/s],
        predicted for the time when the next command acts, after a frame in which the target was not
        seen; zeros for features that were never measured.

        Args:
            own: The rate of the error (over the features' scales) that the camera's own motion
                causes.
            dt: Time since the last picture [s].
        """
        if not self._filters:
            none = np.zeros(len(self._begun))
            return Prediction.unmeasured(none, none)
        self._mix_and_predict(own, dt)
        return Prediction.unmeasured(*self._ahead(own))

    def _ahead(self, own: OwnMotion) -> tuple[Array, Array, Array]:
        x = sum(m[:, None] * f.x for m, f in zip(self._mu, self._filters, strict=True))
        level = self._level.value
        covariance = np.zeros_like(self._filters[0].covariance)
        for m, f in zip(self._mu, self._filters, strict=True):
            off = f.x - x
            apart = off[:, :, None] * off[:, None, :] / level[:, None, None]
            covariance += m[:, None, None] * (f.covariance + apart)
        model = self._filters[0].model
        error, motion, variance = look_ahead(
            np.asarray(x), covariance, self._begun, own, model, self._model_at[0]
        )
        return error, motion, stated(variance, level, self._features)

    def _mix_and_predict(self, own: OwnMotion, dt: float) -> None:
        """Mix the states of both filters by the models' probabilities, then predict them over dt
        [s], for features that have been measured.
        """
        x, P = (np.array([getattr(f, name) for f in self._filters]) for name in ("x", "covariance"))
        # Blom and Bar-Shalom: probabilities after a possible switch, then the mixed start states.
        coming = np.einsum("ij,ik->jk", self._switch, self._mu)
        for j, f in enumerate(self._filters):
            share = (self._switch[:, j, None] * self._mu / coming[j])[..., None]
            mean = (share * x).sum(axis=0)
            off = x - mean
            apart = off[..., :, None] * off[..., None, :] / self._level.value[:, None, None]
            f.x = where(self._begun, mean, x[j])
            f.covariance = where(self._begun, (share[..., None] * (P + apart)).sum(axis=0), P[j])
            f.use(self._model_at[j](dt))
            f.predict(own.past, self._begun)
        self._mu = np.where(self._begun, coming, self._mu)
