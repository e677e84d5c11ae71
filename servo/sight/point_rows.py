"""Interaction matrices of points in the image, and of the target's corners."""

import numpy as np

from servo.types import Sight
from sim.types import Array


def point_rows(x: Array, y: Array, near: Array) -> tuple[Array, Array]:
    """Return the interaction matrices (n, 6) each of x and of y, for points (n,) in normalised
    coordinates.

    Chaumette and Hutchinson 2006 (Visual servo control, part I: basic approaches, IEEE Robotics
    and Automation Magazine 13), equation 11.

    Args:
        x: To the right.
        y: Down.
        near: Inverse depths 1/Z [1/m].
    """
    none = np.zeros_like(x)
    along_x = -near, none, x * near, x * y, -(1 + x * x), y
    along_y = none, -near, y * near, 1 + y * y, -x * y, -x
    return np.column_stack(along_x), np.column_stack(along_y)


def corner_rows(sight: Sight) -> tuple[Array, Array]:
    """Return those of the target's four corners, with the depth of each in the target's plane."""
    (x, y) = corners_of(sight).T
    return point_rows(x, y, 1 / sight.points[:, 2])


def corners_of(sight: Sight) -> Array:
    """Return the target's corners (4, 2), normalised.

    Raises:
        ValueError: The sight has none.
    """
    return sight.points[:, :2] / sight.points[:, 2:] if sight.corners is None else sight.corners
