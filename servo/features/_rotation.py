"""Rotations as features: the rotation vector theta u, its interaction matrix, and the difference of
two rotation vectors.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from servo.features._base import Features
from servo.types import Sight
from sim.geometry import skew
from sim.types import Array

SOLE_DOF: Mapping[str, str] = {"rx": "wx", "ry": "wy", "rz": "wz"}
"""The component of the twist that each component of theta u alone controls."""
SMALL = 1e-4
"""Below this angle [rad] the series is exact to rounding and the closed form is not."""


class WithRotation(Features):
    """Base class of sets of six features, of which the last three are theta u [rad] of c*Rc, the
    rotation of the camera in the frame of the desired camera.
    """

    def error(self, values: Array, goal: Array) -> Array:
        """Return the error e = s - s* (6,). A rotation has two rotation vectors up to a full turn,
        theta u and (theta - 2 pi) u: that which is nearer to the goal's counts.
        """
        return np.concatenate([values[:3], nearest_turn(values[3:], goal[3:])]) - goal

    def known(self, sight: Sight) -> NDArray[np.bool_]:
        """Return True (6,) for each feature that is measured: the first two always, the third with
        the target's size, rx and ry with the tilt of its plane, rz with its angle.
        """
        tilt = sight.tilt_known
        return np.array([True, True, sight.size_known, tilt, tilt, sight.angle_known])


def theta_u(R: Array) -> Array:
    """Return the rotation vector theta u (3,) [rad] of a rotation matrix (3, 3): the axis times the
    angle, which is 0 to pi.
    """
    return Rotation.from_matrix(R).as_rotvec()


def rotation_rows(w: Array) -> Array:
    """Return Lw (3, 3), which maps the camera's angular velocity [rad/s], in the camera frame, to
    d(theta u)/dt of c*Rc.

    Malis, Chaumette and Boudet 1999 (2 1/2 D visual servoing, IEEE Transactions on Robotics and
    Automation 15), equation 12. A test in a closed loop would not find an error in it, because
    Lw^-1 theta u = theta u.

    Args:
        w: Rotation vector theta u (3,) of c*Rc [rad].
    """
    angle = float(np.linalg.norm(w))
    W = skew(w)
    half = angle / 2
    share = 1 / 12 if angle < SMALL else (1 - half / np.tan(half)) / angle**2
    return np.eye(3) + W / 2 + share * (W @ W)


def nearest_turn(w: Array, other: Array) -> Array:
    """Return w, or the other rotation vector (3,) [rad] of the same rotation, (theta - 2 pi) u: the
    one that is nearer to `other`. So an error of half a turn does not jump.
    """
    angle = float(np.linalg.norm(w))
    if angle == 0.0:
        return w
    opposite = w * (1 - 2 * np.pi / angle)
    return min(w, opposite, key=lambda v: float(np.linalg.norm(v - other)))
