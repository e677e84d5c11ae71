"""The values of servoing: moments, plane, features, command, and what estimators and controllers
are.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Protocol

import numpy as np

from sim.types import Array, Posture

FEATURES = ("xn", "yn", "an", "theta")
"""Names of the four features, in order."""
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

    @staticmethod
    def parallel(depth: float) -> Plane:
        """A plane parallel to the image at a depth [m]."""
        return Plane(0.0, 0.0, 1.0 / depth)


@dataclass(frozen=True, slots=True)
class OwnMotion:
    """The part of de/dt that the camera's own motion causes."""

    past: Array
    """Mean over the time since the last frame, from the measured twist (4,)."""
    coming: Array
    """In the frame intervals before the command asked for now acts, the next one first (n, 4)."""

    @staticmethod
    def of(past: Array) -> OwnMotion:
        """Where commands act at once."""
        return OwnMotion(past, np.zeros((0, 4)))


@dataclass(frozen=True, slots=True)
class Outlook:
    """What an estimator says after a frame, in its unit; in a `Command`, in the task's scaling."""

    error: Array
    """The error (4,) to act on: as it was seen, or as it will be when the command acts."""
    motion: Array
    """Estimated de/dt of the target's own motion (4,) [1/s]."""
    innovation: Array
    """Measured minus expected (4,), of what the estimator filters; nan if nothing was measured."""
    nis: Array
    """Innovation squared over its variance (4,), 1 on average where the filter fits; or nan."""

    def times(self, unit: Array) -> Outlook:
        """The same in other units (4,) of the features."""
        return Outlook(self.error * unit, self.motion * unit, self.innovation * unit, self.nis)

    @staticmethod
    def plain(error: Array, motion: Array) -> Outlook:
        """Without innovations."""
        return Outlook(error, motion, np.full(4, np.nan), np.full(4, np.nan))


class Estimator(Protocol):
    """Estimates the part of de/dt that the target's own motion causes.

    It sees xn, yn and an divided by the goal's an: its constants then hold for any scaling, target
    and depth.
    """

    def update(self, error: Array, own: OwnMotion, dt: float) -> Outlook:
        """The outlook after a frame.

        Args:
            error: Feature error e_k (4,).
            own: What the camera's own motion does to it.
            dt: Time since the last frame [s].
        """
        ...

    def skip(self, own: OwnMotion, dt: float) -> Outlook:
        """The outlook after a frame in which the target was not seen.

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
class Command:
    """What a controller says about one frame. Features are in the task's scaling."""

    twist: Array
    """Camera twist (6,) in the camera frame [m/s, rad/s]."""
    features: Array
    """s (4,): xn, yn, an, theta; as last seen where the target was not."""
    error: Array
    """Feature error e = s - s* (4,)."""
    outlook: Outlook
    """What the estimator says."""
    target_motion_measured: Array
    """de/dt of the target's own motion as measured over the last frame interval; nan where it was
    not.
    """
    saturated: bool
    """Whether a limit of speed or acceleration made the twist another one."""
    mode: Mode = Mode.SERVOING
    """What the controller is doing."""

    @property
    def target_motion(self) -> Array:
        """Estimated de/dt of the target's own motion (4,), all features, fed forward or not."""
        return self.outlook.motion


@dataclass(frozen=True, slots=True)
class Sight:
    """The target as it is seen."""

    moments: Moments
    plane: Plane
    """Where it lies, as far as is known."""
    known: tuple[bool, bool, bool, bool] = (True, True, True, True)
    """Which of the features are seen at all; the others are left as they are."""


@dataclass(frozen=True, slots=True)
class Task:
    """What a controller is to do."""

    goal: Sight
    """How the target shall be seen."""
    scale: float
    """K of the features an = K / sqrt(a): see features.py."""
    estimator: Estimator
    """Where the target's own motion comes from."""
    latency: int = 0
    """Frames until a command acts."""


class Controller(Protocol):
    """Turns features into camera twists."""

    def start(self, task: Task) -> None:
        """Begin a task."""
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
