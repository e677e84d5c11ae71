"""Kalman filters of the feature error itself: the camera's motion is a known input, and the noise
is on the error.

For each feature, with T the frame interval, u the de/dt that the camera causes, m the state of the
target's motion (M its transition, r what it adds to the error in a frame), n the tracker's noise,
which is correlated in time by phi, and w, w' white noises:

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
    """Linear model of how the target's own motion changes the error of one feature from frame to
    frame. Covariances are over the variance of the measurement.
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
    """Test that detects a jump of a feature's velocity, after which its filter no longer fits."""

    def jumped(self, normalised: Array) -> Flags:
        """Return True (k,) for each feature whose velocity has jumped.

        Args:
            normalised: Innovations (k,) over their standard deviations; 0 if not measured.
        """
        ...


def model_of(motion: TargetModel, dt: float) -> Model:
    """Return the Kalman model of the state (e, m, n), error, target's motion and tracker's noise,
    at a frame interval dt [s], for a measurement of variance 1.
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
    """Return a function with a cache that returns the Kalman model of the state (e, m, n) from a
    frame interval [s].

    Args:
        motion_at: Function that returns the model of the target's motion from a frame interval [s].
    """
    return cache(lambda dt: model_of(motion_at(dt), dt))


def _diagonal(error: float, motion: Array, noise: float) -> Array:
    """Return the block-diagonal matrix (m + 2, m + 2) of the state's three parts: error (a number),
    motion of the target (m, m), noise of the tracker (a number).
    """
    found = np.diag([error, *np.zeros(len(motion)), noise])
    found[1:-1, 1:-1] = motion
    return found


@final
class ErrorFilters:
    """Estimator of the error, and of de/dt of the target's own motion, by a Kalman filter for each
    feature that measures its error.
    """

    def __init__(
        self,
        motion_at: Callable[[float], TargetModel],
        *,
        predicts: bool = False,
        test: Callable[[], JumpTest] | None = None,
    ) -> None:
        """Create the filters; that of a feature starts with the feature's first measurement.

        Args:
            motion_at: Function that returns the model of the target's motion from a frame interval
                [s].
            predicts: Whether the returned error is the one predicted for the time at which the
                command acts; otherwise it is the measured one.
            test: Function that makes the test which finds features whose velocity jumped; None: no
                test.
        """
        self._predicts = predicts
        self._new_test = test
        self._model = models(motion_at)

    def start(self, features: FeatureSet) -> None:
        """Begin a run with a feature set: no feature has been measured yet."""
        self._features = features
        self._level = Level(np.square(features.noise))
        self._spread = Level(np.square(features.noise))
        self._begun = np.zeros(len(features.names), dtype=bool)
        self._filters: KalmanFilters | None = None
        self._test = None if self._new_test is None else self._new_test()

    def update(self, error: Array, own: OwnMotion, dt: float) -> Prediction:
        """Predict and correct the filters after a picture; return error, de/dt of the target's own
        motion, innovations and variances. The first error of a feature starts its filter.

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
        seen = np.isfinite(error)
        # A feature that is measured for the first time has no expectation, so no innovation.
        self._corrected = measured = seen & self._begun
        before = f.x, f.covariance
        f.predict(own.past, self._begun)
        expected = f.expected
        y = self._features.error(np.where(seen, error, expected), expected)
        S = f.S
        ratio = y**2 / S
        jumped = np.zeros_like(measured)
        if self._test is not None:
            normalised = np.where(measured, y / np.sqrt(S * self._level.value), 0.0)
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
        """Undo the correction by the previous picture if the target is not seen in this one: it was
        probably half hidden before. The first measurement of a feature is kept.

        Args:
            view: Data of the picture; `view.seen` is False if the target is not seen.
        """
        if view.seen is False and self._filters is not None:
            self._filters.forget(self._corrected)

    def skip(self, own: OwnMotion, dt: float) -> Prediction:
        """Return the predicted error and de/dt for a frame in which the target was not seen. The
        error is 0 without `predicts`, and for features that were never measured.
        """
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
            shown, motion, variance = look_ahead(
                f.x, f.covariance, self._begun, own, f.model, self._model
            )
        else:
            seen = np.isfinite(error)
            shown = np.where(seen, error, 0.0)
            motion = f.x[:, 1].copy()
            # The error as it was seen is wrong by the whole noise of the tracker.
            variance = np.array([np.where(seen, 1.0, np.nan), f.covariance[:, 1, 1]])
        return shown, motion, stated(variance, level, self._features)


def stated(variance: Array, level: Array, features: FeatureSet) -> Array:
    """Return the variances (2, k) of error and de/dt against the truth, in the features' scales:
    those of the filter, and for the error also that of the part of the tracker's error that lasts
    for seconds.

    Args:
        variance: Variances (2, k) of the filter, over `level`.
        level: Variance (k,) of each feature's noise, as learned.
        features: The feature set, whose `noise` gives the slow part.
    """
    slow = np.square(SLOW_ERROR * features.noise)
    return variance * level + np.array([slow, np.zeros(len(slow))])


def look_ahead(
    x: Array,
    covariance: Array,
    begun: Flags,
    own: OwnMotion,
    model: Model,
    model_at: Callable[[float], Model],
) -> tuple[Array, Array, Array]:
    """Return the error (k,) when the command that is now computed begins to act, the target's mean
    de/dt (k,) over one frame interval from then on, and the variances (2, k) of both, divided by
    the variance of each feature's noise.

    Args:
        x: States (k, n), each (error, motion of the target, noise of the tracker), at the time of
            the picture.
        covariance: Covariances (k, n, n) of these states, divided by the same variances.
        begun: True (k,) for features that have been measured; error and de/dt of the others are 0.
        own: The camera's own motion until the command acts.
        model: The filter's model at the frame interval.
        model_at: Function that returns the model at another interval [s].
    """
    parts = [model] * len(own.coming)
    if own.durations is not None:
        parts = [model_at(float(held)) for held in own.durations]
    for coming, part in zip(own.coming, parts, strict=True):
        x = x @ part.F.T + coming[:, None] * part.B
        covariance = part.F @ covariance @ part.F.T + part.Q
    rows = np.array([np.eye(len(model.H))[0], model.F[0] / model.B[0]])
    rows[1, 0] = 0.0
    variance = np.einsum("ri,kij,rj->rk", rows, covariance, rows)
    error = np.where(begun, x[:, 0], 0.0)
    return error, x[:, 1:] @ model.F[0, 1:] / model.B[0], variance
