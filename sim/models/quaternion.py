"""Conversion between rotation matrices and quaternions (w, x, y, z), as MuJoCo's models have
them.
"""

from collections.abc import Iterable

import mujoco
import numpy as np

from sim.types import Array


def matrix_of(quaternion: Iterable[float]) -> Array:
    """Return the rotation matrix (3, 3) of a quaternion (w, x, y, z), which has to have length 1:
    it is not normalised here.
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
