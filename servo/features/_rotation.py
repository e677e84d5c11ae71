"""Rotations as features: theta u, its interaction matrix, and the difference of two of them."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from servo.types import Sight
from sim.geometry import skew
from sim.types import Array

SOLE_DOF: Mapping[str, str] = {"rx": "wx", "ry": "wy", "rz": "wz"}
"""Rotations that one part of theta u alone controls."""
SMALL = 1e-4
"""Below this angle [rad] the series is exact to rounding and the closed form is not."""


class WithRotation:
    """What feature sets share that end in theta u of c*Rc."""

    def error(self, values: Array, goal: Array) -> Array:
        """Return e = s - s* (6,); of the two rotation vectors of a rotation, the nearer one."""
        return np.concatenate([values[:3], nearest_turn(values[3:], goal[3:])]) - goal

    def known(self, sight: Sight) -> NDArray[np.bool_]:
        """Return six flags: a similarity has no tilt."""
        tilt = sight.tilt_known
        return np.array([True, True, sight.size_known, tilt, tilt, sight.angle_known])

    def scales(self, goal: Array) -> Array:
        """Return ones (6,)."""
        return np.ones(6)


def theta_u(R: Array) -> Array:
    """Return the rotation vector (3,) [rad] of a rotation, by up to half a turn."""
    return Rotation.from_matrix(R).as_rotvec()


def rotation_rows(w: Array) -> Array:
    """Return Lw (3, 3): d(theta u)/dt of c*Rc over the camera's angular velocity.

    Malis, Chaumette and Boudet 1999 (2 1/2 D visual servoing, IEEE Transactions on Robotics and
    Automation 15), equation 12. No closed loop can see an error in it, as Lw^-1 theta u = theta u.

    Args:
        w: theta u of c*Rc [rad].
    """
    angle = float(np.linalg.norm(w))
    W = skew(w)
    half = angle / 2
    share = 1 / 12 if angle < SMALL else (1 - half / np.tan(half)) / angle**2
    return np.eye(3) + W / 2 + share * (W @ W)


def nearest_turn(w: Array, other: Array) -> Array:
    """Return the rotation vector (3,) of the same rotation as w that is nearest to another: at half
    a turn the axis changes its sign, but nothing jumps.
    """
    angle = float(np.linalg.norm(w))
    if angle == 0.0:
        return w
    other_way = w * (1 - 2 * np.pi / angle)
    return min(w, other_way, key=lambda v: float(np.linalg.norm(v - other)))
