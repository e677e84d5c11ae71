"""Kalman filters of the error itself: the camera's motion is a known input, and the noise is on the
position.

For each feature, with T the frame interval, u the de/dt that the camera causes, m the state of the
target's motion (M its transition, r what it adds to the error in a frame), and n the tracker's
noise:

    e+ = e + T u + r m    m+ = M m + w    n+ = phi n + w'    measured: e + n

The difference of two such measurements, which equation 18 of Teuliere, Marchand and Eck has, shares
a noise with the next difference; the error does not.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Protocol, final

import numpy as np

from servo.estimators._kalman_filters import Flags, KalmanFilters, Level, Model
from servo.parts import FeatureSet
from servo.types import OwnMotion, Prediction
from sim.channels import View
from sim.types import Array

PERSISTENT = 0.5
"""phi: the tracker's error against the truth, a frame later, correlates by 0.3 to 0.8."""
SLOW_ERROR = 6.0
"""Standard deviation of the part of a tracker's error that lasts for seconds, over the features'
noise; from seeds 1 to 6 of `line`, `sine`, `wander` and `circle`. No innovation shows it: to a
filter it is a part of the target's place."""
DIFFUSE = 100.0
"""Standard deviation of an unknown velocity, in the measurement's per frame; its square is that of
an unknown error."""


@dataclass(frozen=True, slots=True)
class TargetModel:
    """How a target moves; all noise is over the measurement's variance."""

    M: Array
    """Transition (m, m) per frame; the first number of the state is de/dt."""
    r: Array
    """What it adds to the error in a frame (m,)."""
    Q: Array
    """Process noise (m, m) per frame."""
    P: Array
    """Covariance at first (m, m), of all but de/dt, which is unknown."""


class JumpTest(Protocol):
    """Decides when a feature's filter no longer fits."""

    def jumped(self, normalised: Array) -> Flags:
        """Return for each feature (k,) whether it jumped, from innovations over their standard
        deviations.
        """
        ...


def model_of(motion: TargetModel, dt: float) -> Model:
    """Return the filter of (e, m, n) at a frame interval [s], for a measurement of variance 1."""
    n = len(motion.r) + 2
    F = _diagonal(1.0, motion.M, PERSISTENT)
    F[0, 1:-1] = motion.r
    Q = _diagonal(0.0, motion.Q, 1 - PERSISTENT**2)
    P = _diagonal(DIFFUSE**4, motion.P, 1.0)
    P[1, 1] += (DIFFUSE / dt) ** 2
    return Model(F, dt * np.eye(n)[0], np.eye(n)[0] + np.eye(n)[-1], Q, 0.0, P)


def models(motion_at: Callable[[float], TargetModel]) -> Callable[[float], Model]:
    """Return the model at an interval [s], kept for the next time."""
    return cache(lambda dt: model_of(motion_at(dt), dt))


def _diagonal(error: float, motion: Array, noise: float) -> Array:
    """Return the block-diagonal matrix of the three parts of the state."""
    found = np.diag([error, *np.zeros(len(motion)), noise])
    found[1:-1, 1:-1] = motion
    return found


@final
class ErrorFilters:
    """One filter for each feature; the model is that of the interval."""

    def __init__(
        self,
        motion_at: Callable[[float], TargetModel],
        *,
        predicts: bool = False,
        test: Callable[[], JumpTest] | None = None,
    ) -> None:
        """Build filters that begin with the first measurement.

        Args:
            motion_at: The target's motion at an interval between pictures [s].
            predicts: Return the error as it will be when the command acts, not as it was seen.
            test: Makes what finds features whose motion is to be taken anew.
        """
        self._predicts = predicts
        self._new_test = test
        self._model = models(motion_at)

    def start(self, features: FeatureSet) -> None:
        """Begin with these features."""
        self._features = features
        self._level = Level(np.square(features.noise))
        self._spread = Level(np.square(features.noise))
        self._begun = np.zeros(len(features.names), dtype=bool)
        self._filters: KalmanFilters | None = None
        self._test = None if self._new_test is None else self._new_test()

    def update(self, error: Array, own: OwnMotion, dt: float) -> Prediction:
        """Predict and correct; the first error starts the filter of a feature."""
        if self._filters is None:
            self._filters = KalmanFilters(self._model(dt), len(error))
        self._filters.use(self._model(dt))
        f = self._filters
        seen = np.isfinite(error)
        self._corrected = measured = seen & self._begun
        before = f.x, f.covariance
        f.predict(own.past, self._begun)
        expected = f.expected
        y = self._features.error(np.where(seen, error, expected), expected)
        ratio = y**2 / f.S
        jumped = np.zeros_like(measured)
        if self._test is not None:
            normalised = np.where(measured, y / np.sqrt(f.S * self._level.value), 0.0)
            jumped = measured & self._test.jumped(normalised)
            # Where the velocity has jumped it is unknown before this interval: predict once more.
            f.x, P = before
            P[jumped, 1, 1] += (DIFFUSE / dt) ** 2
            f.covariance = P
            f.predict(own.past, self._begun)
        # A jump is the target's doing: it must not count as noise of the tracker.
        nis = self._level.learn(ratio, measured, but=jumped)
        self._spread.learn(ratio, measured)  # an estimate is less certain where there are jumps
        f.update(y, seen)
        self._begun |= seen
        innovation = np.where(measured, y, np.nan)
        shown, motion, variance = self._result(f, error, own)
        return Prediction(shown, motion, innovation, nis, variance)

    def see(self, view: View) -> None:
        """Where the target is hidden, take back the last measurement: it was partly hidden then.
        The first one of a feature stays.
        """
        if view.seen is False and self._filters is not None:
            self._filters.forget(self._corrected)

    def skip(self, own: OwnMotion, dt: float) -> Prediction:
        """Return the prediction, less certain with each frame."""
        if self._filters is None:
            none = np.zeros(len(self._begun))
            return Prediction.unmeasured(none, none)
        self._filters.use(self._model(dt))
        self._filters.predict(own.past, self._begun)
        unseen = np.full(len(self._begun), np.nan)
        return Prediction.unmeasured(*self._result(self._filters, unseen, own))

    def _result(self, f: KalmanFilters, error: Array, own: OwnMotion) -> tuple[Array, Array, Array]:
        level = self._spread.value
        if self._predicts:
            shown, motion, variance = look_ahead(f.x, f.covariance, own, f.model, self._model)
        else:
            seen = np.isfinite(error)
            shown = np.where(seen, error, 0.0)
            motion = f.x[:, 1].copy()
            # The error as it was seen is wrong by the whole noise of the tracker.
            variance = np.stack([np.where(seen, 1.0, np.nan), f.covariance[:, 1, 1]])
        return shown, motion, stated(variance, level, self._features)


def stated(variance: Array, level: Array, features: FeatureSet) -> Array:
    """Return the variances (2, k) of error and motion against the truth, from those over the level
    (k,): the filter's own, and the slow part of the tracker's error.
    """
    slow = np.square(SLOW_ERROR * features.noise)
    return variance * level + np.stack([slow, np.zeros(len(slow))])


def look_ahead(
    x: Array, covariance: Array, own: OwnMotion, model: Model, model_at: Callable[[float], Model]
) -> tuple[Array, Array, Array]:
    """Return the error (k,) when the command asked for now begins to act, the target's mean motion
    (k,) while it does, and the variances (2, k) of both over the level.

    Args:
        x: States (k, n) as of the frame.
        covariance: Their covariances (k, n, n), over the level.
        own: The commands that act before.
        model: The filter's model.
        model_at: The model at another interval [s].
    """
    parts = [model] * len(own.coming)
    if own.durations is not None:
        parts = [model_at(float(held)) for held in own.durations]
    for coming, part in zip(own.coming, parts, strict=True):
        x = x @ part.F.T + np.outer(coming, part.B)
        covariance = part.F @ covariance @ part.F.T + part.Q
    rows = np.stack([np.eye(len(model.H))[0], model.F[0] / model.B[0]])
    rows[1, 0] = 0.0
    variance = np.einsum("ri,kij,rj->rk", rows, covariance, rows)
    return x[:, 0].copy(), x[:, 1:] @ model.F[0, 1:] / model.B[0], variance
