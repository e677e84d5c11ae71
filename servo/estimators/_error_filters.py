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
"""phi: errors of trackers in successive frames correlate by 0.3 to 0.8."""
SLOW_ERROR = 6.0
"""Standard deviation of the part of a tracker's error that lasts for seconds, over the features'
noise; fitted to seeds 1 to 6 of `line`, `sine`, `wander` and `circle`. Innovations do not show it:
a filter takes it as a part of the target's position."""
DIFFUSE = 100.0
"""Standard deviation of an unknown velocity, in those of the measurement per frame; its square is
the standard deviation of an unknown error."""


@dataclass(frozen=True, slots=True)
class TargetModel:
    """Linear model of how the target's motion changes the error of a feature. Covariances are
    relative to the variance of the measurement.
    """

    M: Array
    """Transition (m, m) per frame; the first number of the state is de/dt."""
    r: Array
    """Change of the error in a frame, per state (m,)."""
    Q: Array
    """Process noise (m, m) per frame."""
    P: Array
    """Initial covariance (m, m), without that of de/dt, which is unknown."""


class JumpTest(Protocol):
    """Detects that the velocity of a feature has jumped, so that its filter no longer fits."""

    def jumped(self, normalised: Array) -> Flags:
        """Return True (k,) for each feature that jumped, given innovations (k,) over their standard
        deviations.
        """
        ...


def model_of(motion: TargetModel, dt: float) -> Model:
    """Return the model of the state (e, m, n) at a frame interval [s], for a measurement of
    variance 1.
    """
    n = len(motion.r) + 2
    F = _diagonal(1.0, motion.M, PERSISTENT)
    F[0, 1:-1] = motion.r
    Q = _diagonal(0.0, motion.Q, 1 - PERSISTENT**2)
    P = _diagonal(DIFFUSE**4, motion.P, 1.0)
    # Error and velocity are unknown at first: a diffuse prior, far above the noise.
    P[1, 1] += (DIFFUSE / dt) ** 2
    return Model(F, dt * np.eye(n)[0], np.eye(n)[0] + np.eye(n)[-1], Q, 0.0, P)


def models(motion_at: Callable[[float], TargetModel]) -> Callable[[float], Model]:
    """Return a cached function from a frame interval [s] to the model of the filter."""
    return cache(lambda dt: model_of(motion_at(dt), dt))


def _diagonal(error: float, motion: Array, noise: float) -> Array:
    """Return the block-diagonal matrix of the state's three parts: error, motion of the target,
    noise of the tracker.
    """
    found = np.diag([error, *np.zeros(len(motion)), noise])
    found[1:-1, 1:-1] = motion
    return found


@final
class ErrorFilters:
    """Estimates the error, and de/dt of the target's own motion, by a Kalman filter of each
    feature's error.
    """

    def __init__(
        self,
        motion_at: Callable[[float], TargetModel],
        *,
        predicts: bool = False,
        test: Callable[[], JumpTest] | None = None,
    ) -> None:
        """Create the filters; each begins with the first measurement of its feature.

        Args:
            motion_at: Returns the target's motion model at a frame interval [s].
            predicts: Return the error at the time when the command acts, not the measured one.
            test: Makes the test that finds features whose velocity jumped; None: no test.
        """
        self._predicts = predicts
        self._new_test = test
        self._model = models(motion_at)

    def start(self, features: FeatureSet) -> None:
        """Begin a run with a feature set."""
        self._features = features
        self._level = Level(np.square(features.noise))
        self._spread = Level(np.square(features.noise))
        self._begun = np.zeros(len(features.names), dtype=bool)
        self._filters: KalmanFilters | None = None
        self._test = None if self._new_test is None else self._new_test()

    def update(self, error: Array, own: OwnMotion, dt: float) -> Prediction:
        """Predict and correct; the first error of a feature starts its filter."""
        if self._filters is None:
            self._filters = KalmanFilters(self._model(dt), len(error))
        self._filters.use(self._model(dt))
        f = self._filters
        seen = np.isfinite(error)
        # A feature that is measured for the first time has no expectation, so no innovation.
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
        """Take back the last measurement if the target is now hidden: it was partly hidden then.
        The first measurement of a feature stays.

        Args:
            view: Its `seen` says whether the target is seen.
        """
        if view.seen is False and self._filters is not None:
            self._filters.forget(self._corrected)

    def skip(self, own: OwnMotion, dt: float) -> Prediction:
        """Return error and de/dt predicted for a frame without measurement."""
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
    """Return the variances (2, k) of error and motion against the truth: those of the filter, and
    for the error the slow part of the tracker's error, too.

    Args:
        variance: Variances (2, k) of the filter, over the level.
        level: Variance (k,) of each feature's noise.
        features: The feature set.
    """
    slow = np.square(SLOW_ERROR * features.noise)
    return variance * level + np.stack([slow, np.zeros(len(slow))])


def look_ahead(
    x: Array, covariance: Array, own: OwnMotion, model: Model, model_at: Callable[[float], Model]
) -> tuple[Array, Array, Array]:
    """Return the error (k,) when the command asked for now begins to act, the target's mean motion
    (k,) while it does, and the variances (2, k) of both over the level.

    Args:
        x: States (k, n) at the time of the frame.
        covariance: Their covariances (k, n, n), over the level.
        own: The camera's own motion until the command acts.
        model: The filter's model.
        model_at: Returns the model at another interval [s].
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
