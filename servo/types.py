"""The values of servoing: what is seen, features, commands; what estimators and controllers are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from sim.types import Array, Camera, Posture

DOF = ("vx", "vy", "vz", "wx", "wy", "wz")
"""Names of the six parts of a camera twist, in order."""


@dataclass(frozen=True, slots=True)
class Moments:
    """Area, centroid and central moments of a dense silhouette in normalised image coordinates."""

    area: float
    xg: float
    yg: float
    mu20: float
    mu11: float
    mu02: float
    mu30: float
    mu21: float
    mu12: float
    mu03: float


@dataclass(frozen=True, slots=True)
class Plane:
    """The target's plane in the camera frame: 1/Z = A x + B y + C."""

    A: float
    B: float
    C: float

    @property
    def vector(self) -> Array:
        """(A, B, C): the normal, over its distance from the camera."""
        return np.array([self.A, self.B, self.C])


@dataclass(frozen=True, slots=True)
class Sight:
    """The target as it is seen."""

    moments: Moments
    plane: Plane
    """Where it lies, as far as is known."""
    angle_known: bool = True
    """Whether the angle is measured; a tracker that does not follow it only assumes it."""
    size_known: bool = True
    """Whether the size is measured."""


class FeatureSet(Protocol):
    """What is servoed: k named functions of the sight, and their interaction matrix."""

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
        """The features (k,)."""
        ...

    def matrix(self, sight: Sight) -> Array:
        """The interaction matrix (k, 6): ds/dt = L v for a target that stands still."""
        ...

    def error(self, values: Array, goal: Array) -> Array:
        """The error (k,): values minus goal, angles wrapped."""
        ...

    def known(self, sight: Sight) -> NDArray[np.bool_]:
        """Which features (k,) are measured; the others are left as they are."""
        ...

    def scales(self, goal: Array) -> Array:
        """What estimators divide the features by (k,), at a goal (k,); 1 for angles. Their
        constants then hold for any target and depth.
        """
        ...


@dataclass(frozen=True, slots=True)
class OwnMotion:
    """The part of de/dt that the camera's own motion causes."""

    past: Array
    """Mean over the time since the last frame, from the measured twist (k,)."""
    coming: Array
    """In the frame intervals before the command asked for now acts, the next one first (n, k)."""


@dataclass(frozen=True, slots=True)
class Prediction:
    """What an estimator returns for a frame."""

    error: Array
    """The error (k,) to act on: as it was seen, or as it will be when the command acts."""
    motion: Array
    """Estimated de/dt of the target's own motion (k,) [1/s]."""
    innovation: Array
    """Measured minus expected (k,), of what the estimator filters; nan if nothing was measured."""
    nis: Array
    """Innovation squared over its variance (k,), 1 on average where the filter fits; or nan."""

    def times(self, scales: Array) -> Prediction:
        """The same in other units: multiplied by scales (k,)."""
        return Prediction(
            self.error * scales, self.motion * scales, self.innovation * scales, self.nis
        )

    @staticmethod
    def unmeasured(error: Array, motion: Array) -> Prediction:
        """Without innovations."""
        none = np.full(len(error), np.nan)
        return Prediction(error, motion, none, none)


class Estimator(Protocol):
    """Estimates the part of de/dt that the target's own motion causes.

    All features are divided by `FeatureSet.scales`.
    """

    def start(self, features: FeatureSet) -> None:
        """Begin with these features."""
        ...

    def update(self, error: Array, own: OwnMotion, dt: float) -> Prediction:
        """The prediction after a frame.

        Args:
            error: Feature error e_k (k,).
            own: What the camera's own motion does to it.
            dt: Time since the last frame [s].
        """
        ...

    def skip(self, own: OwnMotion, dt: float) -> Prediction:
        """The prediction after a frame in which the target was not seen.

        Its error is zero where the estimator predicts none: nothing is servoed then.
        """
        ...


class Mode(Enum):
    """What a controller is doing; each member carries its sentence."""

    SERVOING = "The target is seen and followed."
    COASTING = "The target is not seen: the camera goes on as the estimate says."
    HOLDING = "The target has not been seen for too long: the camera stands."
    SEARCHING = "The camera looks for the target."


@dataclass(frozen=True, slots=True)
class Trace:
    """How a law came to its twist, for the log."""

    features: Array
    """s (k,); as last seen where the target was not."""
    error: Array
    """Feature error e = s - s* (k,)."""
    prediction: Prediction
    """What the estimator returned."""
    scales: Array
    """What the estimator's features were divided by (k,)."""
    own: Array
    """de/dt (k,) that the camera's own motion caused since the last frame, over `scales`."""


@dataclass(frozen=True, slots=True)
class Command:
    """What a controller asks for after one frame."""

    twist: Array
    """Camera twist (6,) in the camera frame [m/s, rad/s]."""
    saturated: bool = False
    """Whether a limit of speed or acceleration changed the twist."""
    mode: Mode = Mode.SERVOING
    """What the controller is doing."""
    trace: Trace | None = None
    """How it came to this; None for a controller without features."""


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
    latency: int = 0
    """Frames until a command acts."""


class Controller(Protocol):
    """Turns what is seen into camera twists."""

    def start(self, task: Task) -> None:
        """Begin a task.

        Raises:
            ValueError: A setting does not fit the features.
        """
        ...

    def aim(self, goal: Sight) -> None:
        """Go on with another goal."""
        ...

    def command(self, seen: Sight | None, posture: Posture, dt: float) -> Command:
        """The twist to ask for now.

        Args:
            seen: The target, None where it was not seen.
            posture: What the robot knows of itself.
            dt: Time since the last frame [s].
        """
        ...
