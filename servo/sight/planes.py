"""The target's plane in the camera frame: from its size, from its depth, or from its height."""

from __future__ import annotations

from math import sqrt

import numpy as np

from servo.types import Moments, Plane
from sim.types import Array, Pose

EDGE_ON = 0.05
"""The size of a plane that is seen at a smaller angle [rad] does not determine its depth."""
FACING = np.array([0.0, 0.0, 1.0])
"""Normal (3,) of a plane parallel to the image."""


def plane_of_size(m: Moments, root_area: float, normal: Array) -> Plane:
    """Return the plane with this normal (3,) in which a target of known metric area has these
    moments.

    A small piece S of the plane n P = 1 has the image area a = S (n r)^3 / |n|, where r = (xg, yg,
    1): this gives |n|, and with it the depth, from size alone.

    Args:
        m: What is seen.
        root_area: Square root of the metric area [m].
        normal: Normal (3,), of any length.
    """
    A, B, C = normal.tolist()
    facing = (A * m.xg + B * m.yg + C) / sqrt(A * A + B * B + C * C)
    return plane_of_depth(m, root_area * sqrt(max(facing, EDGE_ON) / m.area), normal)


def plane_of_depth(m: Moments, depth: float, normal: Array) -> Plane:
    """Return the plane with this normal (3,), at a depth [m] where the target's centre is seen."""
    A, B, C = normal.tolist()
    along = depth * (A * m.xg + B * m.yg + C)
    return Plane(A / along, B / along, C / along)


def level_plane(T_base_camera: Pose, height: float) -> Plane:
    """Return the level plane at a height [m] over the robot's base, seen by a camera above it."""
    up = T_base_camera.rotation[2]
    return Plane(*(up / (height - T_base_camera.translation[2])).tolist())
