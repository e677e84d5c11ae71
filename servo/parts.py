"""What feature sets, estimators and controllers are: the parts of a loop that have kinds."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from servo.types import Command, OwnMotion, Prediction, Sight
from sim.types import Array, Camera, Frame, Posture


class FeatureSet(Protocol):
    """What is servoed: k named functions of the sight, and their interaction matrix.

    The `Config` of a set that is made of pixels declares `needs = frozenset({Channel.PICTURE,
    Channel.GOAL_PICTURE})`: `Sight.picture` is there then, and in the goal too.
    """

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the features, in order."""
        ...

    @property
    def units(self) -> tuple[str, ...]:
        """Their units, such as "m", "rad", or "1" for a plain number."""
        ...

    @property
    def noise(self) -> Array:
        """Standard deviation (k,) of each feature from frame to frame, over `scales`: estimators
        weigh the features by it.
        """
        ...

    @property
    def feed_forward(self) -> tuple[str, ...]:
        """Features whose target motion a law compensates where the user names no others."""
        ...

    @property
    def sole_dof(self) -> Mapping[str, str]:
        """Degrees of freedom that one feature alone controls, by its name: such a part of the
        twist is zero while the feature is not known.
        """
        ...

    def values(self, sight: Sight) -> Array:
        """Return the features (k,)."""
        ...

    def matrix(self, sight: Sight) -> Array:
        """Return the interaction matrix (k, 6): ds/dt = L v for a target that stands still."""
        ...

    def error(self, values: Array, goal: Array) -> Array:
        """Return the error (k,): values minus goal, angles wrapped."""
        ...

    def known(self, sight: Sight) -> NDArray[np.bool_]:
        """Return which features (k,) are measured; the others are left as they are."""
        ...

    def scales(self, goal: Array) -> Array:
        """Return what estimators divide the features by (k,), at a goal (k,); 1 for angles. Their
        constants then hold for any target and depth.
        """
        ...


@runtime_checkable
class OwnInverse(Protocol):
    """A feature set that gives the law an inverse of its own, where all features are known."""

    def inverse(self, L: Array, values: Array, camera: Camera) -> Array:
        """Return the map (6, k) from e to the twist, in place of the pseudo-inverse L#.

        Args:
            L: The interaction matrix (k, 6) that the law has chosen.
            values: The features (k,) as they were last seen.
            camera: Intrinsics and image size.
        """
        ...


class FeaturesConfig(Protocol):
    """The settings of a feature set."""

    def build(self, outline: Array) -> FeatureSet:
        """Return the set for a target whose reference rectangle has these corners (4, 3) [m]."""
        ...


class Estimator(Protocol):
    """Estimates the part of de/dt that the target's own motion causes.

    All features are divided by `FeatureSet.scales`. One whose `Config` declares
    `Channel.SEEN` is told before each call whether the target is seen, so that it can take back
    what it measured while the target began to be hidden.
    """

    def start(self, features: FeatureSet) -> None:
        """Begin with these features."""

    def update(self, error: Array, own: OwnMotion, dt: float) -> Prediction:
        """Return the prediction after a frame.

        Args:
            error: Feature error e_k (k,); nan for features that were not measured.
            own: What the camera's own motion does to it.
            dt: Time since the last picture that the tracker took [s].
        """
        ...

    def skip(self, own: OwnMotion, dt: float) -> Prediction:
        """Return the prediction after a frame in which the target was not seen.

        Its error is zero where the estimator predicts none: nothing is servoed then.
        """
        ...


@dataclass(frozen=True, slots=True)
class Task:
    """What a controller is to do."""

    goal: Sight
    """How the target shall be seen."""
    features: FeatureSet
    """What is servoed."""
    estimator: Estimator
    """Where the target's own motion comes from; it has been started."""
    camera: Camera
    """Intrinsics and image size."""
    outline: Array
    """Corners (4, 3) of the target's reference rectangle in its frame [m]."""
    latency: float = 0
    """Frame intervals until a command acts."""


class Controller(Protocol):
    """Turns what is seen into camera twists.

    The `Config` of a controller that acts on pictures declares `needs =
    frozenset({Channel.PICTURE})`, with `Channel.GOAL_PICTURE` to have one of the goal too: then
    `Sight.picture` is there, and the sight is None for dropped frames only.
    """

    def start(self, task: Task) -> None:
        """Begin a task.

        Raises:
            ValueError: A setting does not fit the features.
        """

    def command(self, seen: Sight | None, posture: Posture, dt: float) -> Command:
        """Return the twist to ask for now.

        Args:
            seen: The target, None where it was not seen. Its `goal` is the desired sight; where
                the goal moves, it is another one than that of the task.
            posture: What the robot knows of itself.
            dt: Time since the last picture that the tracker took [s].
        """
        ...


@runtime_checkable
class ChoosesMoves(Protocol):
    """Settings of a controller that choose the degrees of freedom that it moves."""

    def moves(self, *, six: bool) -> NDArray[np.bool_]:
        """Return the degrees of freedom (6,) that may move, where six can be controlled or only
        four.
        """
        ...


class GoalSource(Protocol):
    """Where the goal of each picture comes from."""

    @property
    def moved_by(self) -> str:
        """The setting with which the goal moves; empty where it stays."""
        ...

    def sight(self, frame: Frame, *, by_corners: bool) -> Sight | None:
        """Return the desired sight at the time of a frame; the same object while the goal stays,
        and None where the goal is not known.

        Args:
            frame: The picture.
            by_corners: Whether the tracker reports the target's corners.
        """
        ...
