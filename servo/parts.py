"""Protocols of the parts of a control loop that users can write (feature sets, estimators,
controllers and sources of goals), and `Task`, which a controller is given at the start of a run.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from servo.types import Command, OwnMotion, Prediction, Sight
from sim.types import Array, Camera, Frame, Posture


class FeatureSet(Protocol):
    """k visual features, and their interaction matrix: what a control law drives to its goal.

    A new set is a class with these members, built by a `Config` with `build(outline)`. The law
    computes e = error(values(sight), values(goal)) and the twist v = -gain L# e from the matrix L.
    `values` of the same `Sight` must always be the same, and `matrix` their derivative:
    `servo.testing.check_features` compares it with finite differences.

    >>> from servo.features import KINDS
    >>> found = KINDS.config("moments").build(np.zeros((4, 3)))
    >>> found.names, found.units
    (('xn', 'yn', 'an', 'theta'), ('m', 'm', 'm', 'rad'))

    The `Config` of a set that is made of pixels declares `needs = frozenset({Channel.PICTURE,
    Channel.GOAL_PICTURE})`: `Sight.picture` is there then, and in the goal too.
    """

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the features, in order."""
        ...

    @property
    def units(self) -> tuple[str, ...]:
        """Units of the features, such as "m", "rad", or "1" for a plain number."""
        ...

    @property
    def noise(self) -> Array:
        """Standard deviation (k,) of each feature's noise from frame to frame, in the feature's
        unit divided by `scales`: estimators weigh the features by it.
        """
        ...

    @property
    def feed_forward(self) -> tuple[str, ...]:
        """Names of the features for which a law, by default, compensates the target's own motion
        (feed-forward).
        """
        ...

    @property
    def sole_dof(self) -> Mapping[str, str]:
        """Component of the camera twist ("vx" to "wz") that a feature alone controls, by the
        feature's name: this component is zero while the feature is not measured.
        """
        ...

    def values(self, sight: Sight) -> Array:
        """Return the values s (k,) of the features, in `units`.

        Args:
            sight: The target as it is seen, or its desired view.
        """
        ...

    def matrix(self, sight: Sight) -> Array:
        """Return the interaction matrix L (k, 6) with ds/dt = L v, for a target at rest and a
        camera twist v (6,) in the camera frame [m/s, rad/s].

        Args:
            sight: The target as it is seen, or its desired view.
        """
        ...

    def error(self, values: Array, goal: Array) -> Array:
        """Return the error e (k,) in `units`: values (k,) minus goal (k,), where differences of
        angles are wrapped to half a turn each way (-pi to pi), or to a quarter (-pi/2 to pi/2)
        where front and back of the target look alike.
        """
        ...

    def known(self, sight: Sight) -> NDArray[np.bool_]:
        """Return flags (k,): True for each feature that is measured in this view of the target; the
        law does not servo the others.
        """
        ...

    def scales(self, goal: Array) -> Array:
        """Return the numbers (k,), 1 for angles, by which errors of the features are divided before
        an estimator gets them, so that the estimator's constants hold for any target and depth.

        Args:
            goal: The features (k,) in the desired view, from which the numbers are computed.
        """
        ...


@runtime_checkable
class OwnInverse(Protocol):
    """Protocol of a feature set with an inverse of the interaction matrix of its own, which
    replaces the law's pseudo-inverse while all features are measured and, if there are six or more,
    the tilt of the target's plane too. All six components of the camera twist may then move. It is
    not used for robots with one to five joints.
    """

    def inverse(self, L: Array, values: Array, camera: Camera) -> Array:
        """Return the matrix (6, k) that replaces the pseudo-inverse L# in the law v = -gain L# e,
        with the feature error e (k,) and the camera twist v (6,) in the camera frame [m/s, rad/s].

        Args:
            L: The interaction matrix (k, 6): that of the present view, of the goal or their mean,
                as the law's settings choose.
            values: The features (k,), in their units, as they were last measured.
            camera: Intrinsics and image size [px].
        """
        ...


class FeaturesConfig(Protocol):
    """Protocol of the settings of a feature set, which build the set for a target."""

    def build(self, outline: Array) -> FeatureSet:
        """Return the feature set of a target.

        Args:
            outline: Corners (4, 3) of its reference rectangle in the target's frame [m], clockwise
                as seen from above.
        """
        ...


class Estimator(Protocol):
    """Protocol of an estimator of the part of de/dt (the rate of the feature error) that the
    target's own motion causes, so that the law can compensate it.

    A new estimator is a class with these methods, built by a `Config` with `build(rng)`. After each
    frame the law calls `update`, or `skip` if the target was not seen, and subtracts the
    prediction's motion: v = -L# (gain e + de/dt).

    >>> from servo.estimators import KINDS
    >>> estimator = KINDS.config("none").build(np.random.default_rng(0))
    >>> callable(estimator.update) and callable(estimator.skip)
    True

    All errors and motions are divided by `FeatureSet.scales`. An estimator whose `Config` declares
    `Channel.SEEN` also has a method `see(view)`, called before each `update` or `skip`: `view.seen`
    is False if the target is not seen in the picture, so that the estimator can discard its last
    measurement, of a target that was perhaps partly hidden; it is None without a new picture.
    """

    def start(self, features: FeatureSet) -> None:
        """Begin a run; called once, before the first `update` or `skip`.

        Args:
            features: The feature set, whose errors are given to `update`.
        """

    def update(self, error: Array, own: OwnMotion, dt: float) -> Prediction:
        """Return the prediction after a frame in which the target was seen: the feature error (k,),
        and the rate (k,) [1/s] that the target's own motion gives it.

        Args:
            error: Feature error e (k,), divided by `FeatureSet.scales`; nan for features that were
                not measured.
            own: The part of de/dt that the camera's own motion causes, divided by
                `FeatureSet.scales`.
            dt: Time since the last picture that the tracker took [s].
        """
        ...

    def skip(self, own: OwnMotion, dt: float) -> Prediction:
        """Return the prediction after a frame in which the target was not seen; its innovation is
        nan (k,).

        An estimator that predicts no error returns an error of zero, and the camera is then moved
        by the predicted motion alone.

        Args:
            own: The part of de/dt that the camera's own motion causes, divided by
                `FeatureSet.scales`.
            dt: Time since the last picture that the tracker took [s].
        """
        ...


@dataclass(frozen=True, slots=True)
class Task:
    """What a controller is given at the start of a run: goal, features, estimator, camera, the
    target's corners, and the latency of commands [frame intervals].
    """

    goal: Sight
    """The desired view of the target at the beginning."""
    features: FeatureSet
    """The features that the law drives to their goal."""
    estimator: Estimator
    """Estimates the target's own motion; its `start` has been called."""
    camera: Camera
    """Intrinsics and image size, as the robot believes them."""
    outline: Array
    """Corners (4, 3) of the target's reference rectangle in its frame [m]."""
    latency: float = 0
    """Time from a picture until the command computed from it acts [frame intervals]."""


class Controller(Protocol):
    """Protocol of a control law, which turns views of the target (`Sight`) into camera twists.

    A new controller is a class with these methods, built by a `Config` with `build(rng)`: `start`
    begins a run, and `command` returns the twist after each picture. This one moves the camera
    sideways to the target:

    >>> from servo.types import Command
    >>> class Sideways:
    ...     def start(self, task):
    ...         self.features = task.features
    ...
    ...     def command(self, seen, posture, dt):
    ...         twist = np.zeros(6)
    ...         if seen is not None:
    ...             e = self.features.error(
    ...                 self.features.values(seen), self.features.values(seen.goal)
    ...             )
    ...             twist[:2] = e[:2]
    ...         return Command(twist)

    The `Config` of a controller that acts on pictures declares `needs =
    frozenset({Channel.PICTURE})`, with `Channel.GOAL_PICTURE` to have one of the goal too: then
    `Sight.picture` is there, and the sight is None for dropped frames only.
    """

    def start(self, task: Task) -> None:
        """Begin a run with this task (goal, features, estimator, camera and target); called once,
        before the first `command`.

        Raises:
            ValueError: A setting does not fit the features.
        """

    def command(self, seen: Sight | None, posture: Posture, dt: float) -> Command:
        """Return the command after a picture: the camera twist (6,) in the camera frame [m/s,
        rad/s].

        Args:
            seen: The target as it is seen, with its desired view as `goal` (which may have moved
                since `Task.goal`); None if the target is not seen.
            posture: Camera pose, twist, joints and Jacobian, as the robot knows them.
            dt: Time since the last picture that the tracker took [s].
        """
        ...


@runtime_checkable
class ChoosesMoves(Protocol):
    """Protocol of the settings of a controller that choose which degrees of freedom of the camera
    the controller may move.
    """

    def moves(self, *, six: bool) -> NDArray[np.bool_]:
        """Return flags (6,), in the order vx, vy, vz, wx, wy, wz: True for each degree of freedom
        of the camera that may move.

        Args:
            six: Whether the features control all six degrees of freedom; False: only vx, vy, vz and
                wz.
        """
        ...


class GoalSource(Protocol):
    """Protocol of a source of goals: for each picture of a run, it returns the desired view of the
    target.
    """

    @property
    def moved_by(self) -> str:
        """The setting that makes the goal move, such as "goal.depth_to"; "" for a fixed goal."""
        ...

    def sight(self, frame: Frame, *, by_corners: bool) -> Sight | None:
        """Return the desired view of the target (`Sight`) at the time of a frame; None if the goal
        is not known then. While the goal stays the same, the same object is returned.

        Args:
            frame: The picture with its time.
            by_corners: Whether the tracker reports the target's corners.
        """
        ...
