"""Plane of the target in the camera frame: computed from its metric size, its depth or its height,
or fitted to its positions so far.
"""

from math import sqrt
from typing import final

import numpy as np

from servo.types import Moments, Plane
from sim.types import Array, Pose

EDGE_ON = 0.05
"""Smallest angle between plane and line of sight at which the size determines the depth [rad]."""
FACING = np.array([0.0, 0.0, 1.0])
"""Normal (3,) of a plane parallel to the image."""
TILT_SD = np.radians(10.0)
"""Standard deviation of the tilt between plane and image at the start [rad]."""
DEPTH_SD = 0.02
"""Standard deviation of a point's distance from the plane [m]."""


def plane_of_size(m: Moments, root_area: float, normal: Array) -> Plane:
    """Return the plane with a given normal in the camera frame in which a target of known metric
    area has the image area and centroid of `m`.

    A small piece of the plane n . P = 1 with the metric area S has the image area a = S (n . r)^3 /
    |n| with r = (xg, yg, 1): this gives |n| [1/m], and with it the depth. For a plane that is seen
    nearly edge-on or from behind, n . r / |n| is replaced by 0.05 there.

    Args:
        m: Moments of the target in normalised image coordinates.
        root_area: Square root of the target's metric area [m].
        normal: Direction (3,) of n in the camera frame, of any length; it points away from the
            camera.
    """
    A, B, C = normal.tolist()
    facing = (A * m.xg + B * m.yg + C) / sqrt(A * A + B * B + C * C)
    return plane_of_depth(m, root_area * sqrt(max(facing, EDGE_ON) / m.area), normal)


def plane_of_depth(m: Moments, depth: float, normal: Array) -> Plane:
    """Return the plane in the camera frame that has a given normal, and a given depth at the
    target's centroid.

    Args:
        m: Moments of the target in normalised image coordinates; only the centroid is used.
        depth: Depth Z of the plane at the centroid [m].
        normal: Vector (3,) along the plane's normal in the camera frame, of any length.
    """
    A, B, C = normal.tolist()
    along = depth * (A * m.xg + B * m.yg + C)
    return Plane(A / along, B / along, C / along)


def level_plane(T_base_camera: Pose, height: float) -> Plane:
    """Return a horizontal plane in the camera frame.

    Args:
        T_base_camera: Pose of the camera in the robot's base frame, whose z is up.
        height: Height z of the plane in the base frame [m].
    """
    up = T_base_camera.rotation[2]
    return Plane(*(up / (height - T_base_camera.translation[2])).tolist())


@final
class PlaneFit:
    """Fits a plane to the positions of the target so far (`add`) by least squares, with the prior
    that the camera faces the plane at the start.

    Of all unit normals m it takes the one that minimises

        sum (m (P - mean P))^2 / DEPTH_SD^2  -  (m m0)^2 / TILT_SD^2

    over the positions P, with m0 the optical axis at the start, DEPTH_SD = 0.02 m and TILT_SD = 10
    degrees; m is an eigenvector. Positions on one line give no information on the tilt about this
    line; there the prior stays.
    """

    def __init__(self) -> None:
        self._count = 0
        self._mean = np.zeros(3)
        self._scatter = np.zeros((3, 3))
        self._prior: Array | None = None

    def normal(self, T_base_camera: Pose) -> Array:
        """Return the unit normal (3,) of the fitted plane in the present camera frame, pointing
        away from the camera. The first call stores the present optical axis as the prior of the
        normal; before any `add` the normal is this axis.

        Args:
            T_base_camera: Present pose of the camera in the robot's base frame.
        """
        if self._prior is None:
            self._prior = T_base_camera.rotation[:, 2].copy()
        # The eigenvector of the smallest eigenvalue minimises the sum above.
        prior = np.outer(self._prior, self._prior) / TILT_SD**2
        m = np.linalg.eigh(self._scatter / DEPTH_SD**2 - prior)[1][:, 0]
        seen = T_base_camera.rotation.T @ m
        return seen if seen[2] > 0 else -seen

    def add(self, T_base_camera: Pose, point: Array) -> None:
        """Add a position of the target to those to which the plane is fitted.

        Args:
            T_base_camera: Pose of the camera in the robot's base frame at that time.
            point: Position (3,) of the target in the camera frame [m].
        """
        P = T_base_camera.apply(point)
        self._count += 1
        # Welford's update of mean and scatter.
        before = P - self._mean
        self._mean = self._mean + before / self._count
        self._scatter += np.outer(before, P - self._mean)
