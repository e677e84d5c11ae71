"""Interaction matrices of image points, and of the target's corners."""

import numpy as np

from servo.types import Sight
from sim.types import Array


def point_rows(x: Array, y: Array, near: Array) -> tuple[Array, Array]:
    """Return the interaction matrices (n, 6) of x and of y, for points (n,) in normalised image
    coordinates: each row times a camera twist in the camera frame [m/s, rad/s] is dx/dt or dy/dt of
    a point at rest.

    Chaumette and Hutchinson 2006 (Visual servo control, part I: basic approaches, IEEE Robotics
    and Automation Magazine 13), equation 11.

    Args:
        x: Coordinates to the right (n,).
        y: Coordinates down (n,).
        near: Inverse depths 1/Z [1/m].
    """
    none = np.zeros_like(x)
    along_x = -near, none, x * near, x * y, -(1 + x * x), y
    along_y = none, -near, y * near, 1 + y * y, -x * y, -x
    return np.column_stack(along_x), np.column_stack(along_y)


def corner_rows(sight: Sight) -> tuple[Array, Array]:
    """Return the interaction matrices (4, 6) of x and of y of the target's corners in normalised
    image coordinates, each corner with its depth in the target's plane.
    """
    (x, y) = corners_of(sight).T
    return point_rows(x, y, 1 / sight.points[:, 2])


def corners_of(sight: Sight) -> Array:
    """Return the target's corners (4, 2) in normalised image coordinates, in the order of the
    outline.

    Raises:
        ValueError: `sight` has no corners.
    """
    return sight.points[:, :2] / sight.points[:, 2:] if sight.corners is None else sight.corners
