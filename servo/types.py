"""The values of servoing: what is seen, what is predicted, what is asked for."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from sim.types import Array, Camera, Image, Pose

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
class CameraImage:
    """A picture and the camera that took it."""

    image: Image
    """RGB (H, W, 3)."""
    camera: Camera


@dataclass(frozen=True)
class Sight:
    """The target as it is seen."""

    moments: Moments
    plane: Plane
    """Where it lies, as far as is known: the depths of interaction matrices come from it."""
    angle_known: bool = True
    """Whether the angle is measured; a tracker that does not follow it only assumes it."""
    size_known: bool = True
    """Whether the size is measured."""
    tilt_known: bool = False
    """Whether the tilt of its plane is measured, by a tracker that sees its four corners."""
    corners: Array | None = None
    """Corners (4, 2) of its reference rectangle in normalised image coordinates, in the order of
    the outline; None where nobody needs them."""
    measured_pose: Pose | None = None
    """Its pose, where one was measured; else the pose is what corners and plane say."""
    goal: Sight | None = None
    """How it shall be seen; None in the goal itself."""
    picture: CameraImage | None = None
    """What the camera saw; None where nobody needs it."""

    @property
    def aim(self) -> Sight:
        """How it shall be seen; of a goal, the goal itself."""
        return self.goal or self

    @cached_property
    def pose(self) -> Pose:
        """T_camera_object: origin in the rectangle's centre, x along the nose, z through the
        rectangle away from the camera: no rotation where the camera faces it, its nose to the
        right.
        """
        return self.measured_pose or pose_in_plane(self.points, self.plane.vector)

    @cached_property
    def points(self) -> Array:
        """The corners (4, 3) in the camera frame, in the plane [m].

        Raises:
            ValueError: The sight has no corners.
        """
        if self.corners is None:
            raise ValueError("this sight has no corners; features that need them cannot be had")
        rays = np.column_stack([self.corners, np.ones(4)])
        return rays / (rays @ self.plane.vector)[:, None]


def pose_in_plane(points: Array, normal: Array) -> Pose:
    """Return the pose of a rectangle whose corners (4, 3) [m] lie in a plane with this normal (3,):
    origin in its centre, x towards the second and third corner, z along the normal.
    """
    z = normal / np.linalg.norm(normal)
    ahead = points[1] + points[2] - points[0] - points[3]
    y = np.cross(z, ahead)
    y = y / np.linalg.norm(y)
    return Pose(np.stack([np.cross(y, z), y, z], axis=1, dtype=np.float64), points.mean(axis=0))


@dataclass(frozen=True, slots=True)
class OwnMotion:
    """The part of de/dt that the camera's own motion causes."""

    past: Array
    """Mean over the time since the last frame, from the measured twist (k,)."""
    coming: Array
    """In the time before the command asked for now acts, the next part first (n, k)."""
    durations: Array | None = None
    """How long each of these parts is (n,) [s]; None: a frame interval each."""


@dataclass(frozen=True, slots=True)
class Prediction:
    """What an estimator returns for a frame."""

    error: Array
    """The error (k,) to act on: as it was seen, or as it will be when the command acts."""
    motion: Array
    """Estimated de/dt of the target's own motion (k,) [1/s]."""
    innovation: Array
    """Measured minus expected error (k,); nan if nothing was measured. A filter of de/dt gives its
    own innovation times the interval."""
    nis: Array
    """Innovation squared over its variance (k,), 1 on average where the filter fits; or nan."""
    variance: Array | None = None
    """Stated variances (2, k) of error and motion against the truth; None without a filter."""

    def times(self, scales: Array) -> Prediction:
        """Return the same in other units: multiplied by scales (k,)."""
        return Prediction(
            self.error * scales,
            self.motion * scales,
            self.innovation * scales,
            self.nis,
            None if self.variance is None else self.variance * scales**2,
        )

    @staticmethod
    def unmeasured(error: Array, motion: Array, variance: Array | None = None) -> Prediction:
        """Return a prediction without innovations."""
        none = np.full(len(error), np.nan)
        return Prediction(error, motion, none, none, variance)


class Mode(Enum):
    """What a controller is doing; each member carries its sentence."""

    SERVOING = "The target is seen and followed."
    COASTING = "The target is not seen: the camera follows the predicted motion."
    HOLDING = "The target has not been seen for too long: the camera stands."
    SEARCHING = "The camera searches for the target."


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
    servoed: NDArray[np.bool_] | None = None
    """The features (k,) that the joints can servo; None: all."""
    held: NDArray[np.bool_] | None = None
    """The joints (n,) that the law leaves out, as their ranges end there; None: it leaves none."""


@dataclass(frozen=True, slots=True)
class Command:
    """What a controller asks for after one frame."""

    twist: Array
    """Camera twist (6,) in the camera frame [m/s, rad/s]."""
    saturated: bool = False
    """Whether a limit changed the twist."""
    mode: Mode = Mode.SERVOING
    """What the controller is doing."""
    trace: Trace | None = None
    """How it came to this; None for a controller without features."""
    limits: tuple[str, ...] = ()
    """Names of the limits that changed the twist, where the controller knows them, such as "view
    left", "joint 2" or "speed"."""
    violated: tuple[str, ...] = ()
    """Those among them that no twist could keep: this one violates them least."""
