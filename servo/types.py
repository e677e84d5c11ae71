"""Values that the parts of the control loop exchange: views of the target (`Sight`, with `Moments`,
`Plane` and pictures), the effect of the camera's own motion, predictions of estimators, and
commands of controllers with their intermediate results.
"""

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
    """Area, centroid (xg, yg) and central moments of a filled silhouette (not of a set of points),
    in normalised image coordinates: mu_pq is the integral of (x - xg)^p (y - yg)^q over the
    silhouette.
    """

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
    """The target's plane in the camera frame, 1/Z = A x + B y + C, with x, y in normalised image
    coordinates and A, B, C in 1/m.
    """

    A: float
    B: float
    C: float

    @property
    def vector(self) -> Array:
        """(A, B, C): the unit normal of the plane, which points away from the camera, over the
        plane's distance from the camera [1/m].
        """
        return np.array([self.A, self.B, self.C])


@dataclass(frozen=True, slots=True)
class CameraImage:
    """A picture, RGB, uint8 (H, W, 3), and the intrinsics of the camera that took it."""

    image: Image
    """RGB (H, W, 3)."""
    camera: Camera


@dataclass(frozen=True)
class Sight:
    """The target as a picture shows it: moments and corners in normalised image coordinates, plane
    and pose in the camera frame, whether angle, size and tilt were measured, the desired view
    (`goal`), and the whole picture for features and controllers that use pixels.
    """

    moments: Moments
    plane: Plane
    """The plane of the target in the camera frame, as far as it is known; interaction matrices take
    their depths from it."""
    angle_known: bool = True
    """Whether the target's angle in the image is measured, and not only assumed."""
    size_known: bool = True
    """Whether the target's size in the image is measured, and not only assumed."""
    tilt_known: bool = False
    """Whether the tilt of the target's plane is measured, by four corners or a depth picture."""
    corners: Array | None = None
    """Corners (4, 2) of the target's reference rectangle in normalised image coordinates, in the
    order of the outline; None if they were not computed."""
    measured_pose: Pose | None = None
    """T_camera_object, if it was measured; otherwise `pose` computes it from corners and plane."""
    goal: Sight | None = None
    """The desired view of the target; None if this object is itself the desired view."""
    picture: CameraImage | None = None
    """The whole picture, for features and controllers that use pixels; otherwise None."""

    @property
    def aim(self) -> Sight:
        """The desired view of the target: `goal`, or this object itself if it has no goal."""
        return self.goal or self

    @cached_property
    def pose(self) -> Pose:
        """T_camera_object, the target's pose in the camera frame [m], as measured, or else computed
        from corners and plane (a ValueError if there are no corners). The object's frame has its
        origin in the centre of the reference rectangle, x towards the middle of the second and
        third corner (where the target's nose is), and z along the plane's normal, away from the
        camera: the rotation is the identity if the camera faces the target and sees its nose at the
        right.
        """
        return self.measured_pose or pose_in_plane(self.points, self.plane.vector)

    @cached_property
    def points(self) -> Array:
        """Corners (4, 3) of the target's reference rectangle in the camera frame [m], in the order
        of `Target.outline`, computed from `corners` and `plane`.

        Raises:
            ValueError: There are no corners.
        """
        if self.corners is None:
            raise ValueError(
                "this Sight has no corners, from which its points and its pose are computed: use "
                "them only where `corners` is not None"
            )
        rays = np.ones((4, 3))
        rays[:, :2] = self.corners
        return rays / (rays @ self.plane.vector)[:, None]


def pose_in_plane(points: Array, normal: Array) -> Pose:
    """Return the pose of a rectangle: origin in its centre, x towards the middle of the second and
    third corner, z along the normal.

    Args:
        points: Corners (4, 3) of the rectangle in any frame [m]; the pose is returned in this
            frame.
        normal: Normal (3,) of the rectangle's plane in the same frame, of any length.
    """
    z = normal / np.linalg.norm(normal)
    ahead = points[1] + points[2] - points[0] - points[3]
    y = np.cross(z, ahead)
    y = y / np.linalg.norm(y)
    return Pose(np.stack([np.cross(y, z), y, z], axis=1, dtype=np.float64), points.mean(axis=0))


@dataclass(frozen=True, slots=True)
class OwnMotion:
    """The rate of the feature error, de/dt, that the camera's own motion causes, divided by
    `FeatureSet.scales` [1/s]: its mean since the last picture (`past`), and its values until the
    next command acts (`coming`).
    """

    past: Array
    """Mean de/dt (k,) since the last frame, computed from the measured camera twist [1/s]."""
    coming: Array
    """de/dt (n, k) of the n pieces of time until the next command acts, the earliest first
    [1/s]."""
    durations: Array | None = None
    """Length (n,) of these pieces of time [s]; None: one frame interval each."""


@dataclass(frozen=True, slots=True)
class Prediction:
    """Result of an estimator for a frame: the feature error (k,), and its rate (k,) [1/s] from the
    target's own motion, both divided by `FeatureSet.scales`, with the estimator's innovation and
    the variances that it states.
    """

    error: Array
    """Feature error (k,) for the law: the measured one, or the one predicted for the moment at
    which the command acts."""
    motion: Array
    """Estimated de/dt (k,) caused by the target's own motion [1/s]."""
    innovation: Array
    """Measured minus expected error (k,); nan for features that were not measured, and without a
    filter. A filter of de/dt multiplies its innovation by the frame interval."""
    nis: Array
    """Normalised innovation squared (k,): innovation squared over its variance, 1 on average if the
    filter's model fits; nan where the innovation is."""
    variance: Array | None = None
    """Variances (2, k) of `error` and `motion`; None if the estimator states none."""

    def times(self, scales: Array) -> Prediction:
        """Return a copy of the prediction with error, motion and innovation multiplied by scales
        (k,), and variances by the squares of scales; `nis` is unchanged.
        """
        return Prediction(
            self.error * scales,
            self.motion * scales,
            self.innovation * scales,
            self.nis,
            None if self.variance is None else self.variance * scales**2,
        )

    @staticmethod
    def unmeasured(error: Array, motion: Array, variance: Array | None = None) -> Prediction:
        """Return a prediction without a measurement: its innovation and NIS are nan (k,).

        Args:
            error: Feature error (k,) for the law, divided by `FeatureSet.scales`.
            motion: Estimated de/dt (k,) caused by the target's own motion, divided by the same
                scales [1/s].
            variance: Variances (2, k) of error and motion; None if the estimator states none.
        """
        none = np.full(len(error), np.nan)
        return Prediction(error, motion, none, none, variance)


class Mode(Enum):
    """State of a controller, such as searching for the target; the value of each member is a
    sentence about it.
    """

    SERVOING = "The target is seen and followed."
    COASTING = "The target is not seen: the camera follows the predicted motion."
    HOLDING = "The target has not been seen for too long: the camera stands."
    SEARCHING = "The camera searches for the target."


@dataclass(frozen=True, slots=True)
class Trace:
    """Intermediate results of a control law in one frame, for the log: features and their error,
    the estimator's prediction, the part of de/dt that the camera causes, and which features are
    servoed and which joints held.
    """

    features: Array
    """Features s (k,); while the target is not seen, those that were measured last."""
    error: Array
    """Feature error e = s - s* (k,)."""
    prediction: Prediction
    """The estimator's prediction, in the features' own units."""
    scales: Array
    """`FeatureSet.scales` (k,), by which the estimator's input was divided."""
    own: Array
    """Mean de/dt (k,) caused by the camera's own motion since the last frame, over `scales`
    [1/s]."""
    servoed: NDArray[np.bool_] | None = None
    """True (k,) for each feature that the robot's joints can change; None: all of them."""
    held: NDArray[np.bool_] | None = None
    """True (n,) for each joint that the law holds at an end of its range; None: it holds none."""


@dataclass(frozen=True, slots=True)
class Command:
    """Output of a controller after a picture: the camera twist in the camera frame, the
    controller's mode and intermediate results, and the limits that changed the twist or that it
    violates.
    """

    twist: Array
    """Camera twist (6,) in the camera frame [m/s, rad/s]."""
    saturated: bool = False
    """Whether a limit changed the twist."""
    mode: Mode = Mode.SERVOING
    """What the controller is doing."""
    trace: Trace | None = None
    """Intermediate results; None for a controller without features, or that does not return
    them."""
    limits: tuple[str, ...] = ()
    """Names of the limits that changed the twist, where the controller knows them, such as "view
    left", "joint 2" or "speed"."""
    violated: tuple[str, ...] = ()
    """Names of the limits that no twist can keep; this twist violates them least."""
