"""The values of servoing: moments, plane, features, command, and what estimators and controllers
are.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from sim.types import Array

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

    @staticmethod
    def parallel(depth: float) -> Plane:
        """A plane parallel to the image at a depth [m]."""
        return Plane(0.0, 0.0, 1.0 / depth)


@dataclass(frozen=True, slots=True)
class Command:
    """What a controller says about one frame. Features are in the task's scaling."""

    twist: Array
    """Camera twist (6,) in the camera frame [m/s, rad/s]."""
    features: Array
    """s (4,): xn, yn, an, theta; as last seen where the target was not."""
    error: Array
    """Feature error e = s - s* (4,)."""
    target_motion: Array
    """Estimated de/dt of the target's own motion (4,), all features, fed forward or not [1/s]."""
    target_motion_measured: Array
    """The same as measured over the last frame interval; nan where it was not."""
    saturated: bool
    """Whether a speed limit made the twist shorter."""


class Estimator(Protocol):
    """Estimates the part of de/dt that the target's own motion causes."""

    def update(self, error: Array, own: Array, dt: float) -> Array:
        """The estimate (4,) after a frame.

        Args:
            error: Feature error e_k (4,).
            own: Mean de/dt that the camera's measured motion caused since the last frame (4,).
            dt: Time since the last frame [s].
        """
        ...

    def skip(self) -> Array:
        """The estimate (4,) after a frame in which the target was not seen."""
        ...


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


class Controller(Protocol):
    """Turns features into camera twists."""

    def start(self, task: Task) -> None:
        """Begin a task."""
        ...

    def command(self, seen: Sight | None, twist_measured: Array, dt: float) -> Command:
        """The twist to ask for now.

        Args:
            seen: The target, None where it was not seen.
            twist_measured: Mean camera twist (6,) since the last frame.
            dt: Time since the last frame [s].
        """
        ...
