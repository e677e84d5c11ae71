"""Interaction matrices of the coordinates of image points, and of the target's corners."""

import numpy as np

from servo.types import Sight
from sim.types import Array


def point_rows(x: Array, y: Array, near: Array) -> tuple[Array, Array]:
    """Return two interaction matrices (n, 6), that of the x and that of the y coordinates of n
    image points: each row times a camera twist in the camera frame [m/s, rad/s] is dx/dt or dy/dt
    [1/s] of a point at rest.

    Chaumette and Hutchinson 2006 (Visual servo control, part I: basic approaches, IEEE Robotics and
    Automation Magazine 13), equation 11.

    Args:
        x: Normalised image coordinates X/Z, to the right (n,).
        y: Normalised image coordinates Y/Z, down (n,).
        near: Inverse depths 1/Z (n,) [1/m].
    """
    none = np.zeros_like(x)
    along_x = -near, none, x * near, x * y, -(1 + x * x), y
    along_y = none, -near, y * near, 1 + y * y, -x * y, -x
    return np.column_stack(along_x), np.column_stack(along_y)


def corner_rows(sight: Sight) -> tuple[Array, Array]:
    """Return two interaction matrices (4, 6), that of the x and that of the y coordinates of the
    target's corners in normalised image coordinates; each corner has its own depth in the target's
    plane.

    Raises:
        ValueError: `sight` has no corners.
    """
    (x, y) = corners_of(sight).T
    return point_rows(x, y, 1 / sight.points[:, 2])


def corners_of(sight: Sight) -> Array:
    """Return the target's corners (4, 2) in normalised image coordinates, in the order rear left,
    front left, front right, rear right.

    Raises:
        ValueError: `sight` has no corners.
    """
    return sight.points[:, :2] / sight.points[:, 2:] if sight.corners is None else sight.corners
