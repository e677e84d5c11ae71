"""Interaction matrices of points in the image, and of what is made of them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from servo.types import Sight
from sim.types import Array


class OfCorners:
    """What feature sets of the four corners share."""

    sole_dof: Mapping[str, str] = {}

    def known(self, sight: Sight) -> NDArray[np.bool_]:
        """Corners are known where angle and size are."""
        return np.full(8, sight.angle_known and sight.size_known)

    def scales(self, goal: Array) -> Array:
        """1."""
        return np.ones(8)


def point_rows(x: Array, y: Array, near: Array) -> tuple[Array, Array]:
    """Interaction matrices (n, 6) each of x and of y, for points (n,) in normalised coordinates.

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
    """Those of the target's four corners, with the depth of each in the target's plane."""
    (x, y), near = corners_of(sight).T, 1 / sight.points[:, 2]
    return point_rows(x, y, near)


def corners_of(sight: Sight) -> Array:
    """The target's corners (4, 2), normalised.

    Raises:
        ValueError: The sight has none.
    """
    return sight.points[:, :2] / sight.points[:, 2:] if sight.corners is None else sight.corners


def whole_turn(angles: Array) -> Array:
    """Angles [rad] wrapped to [-pi, pi)."""
    return (angles + np.pi) % (2 * np.pi) - np.pi
