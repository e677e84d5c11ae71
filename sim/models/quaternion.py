"""Rotations as MuJoCo's models have them: quaternions (w, x, y, z)."""

from collections.abc import Iterable

import mujoco
import numpy as np

from sim.types import Array


def matrix_of(quaternion: Iterable[float]) -> Array:
    """Return the rotation matrix (3, 3) of a unit quaternion (w, x, y, z), which is not
    normalised.
    """
    matrix = np.empty(9)
    mujoco.mju_quat2Mat(matrix, np.array(quaternion, float))
    return matrix.reshape(3, 3)


def quaternion_of(rotation: Array) -> Array:
    """Return the unit quaternion (w, x, y, z) of a rotation matrix (3, 3), with the sign that
    MuJoCo gives it.
    """
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, rotation.flatten())
    return quaternion
