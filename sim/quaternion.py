"""Rotations between matrices and quaternions (w, x, y, z), as MuJoCo converts them."""

from collections.abc import Iterable

import mujoco
import numpy as np

from sim.types import Array


def matrix_of(quaternion: Iterable[float]) -> Array:
    """The rotation matrix (3, 3) of a quaternion (4,)."""
    matrix = np.empty(9)
    mujoco.mju_quat2Mat(matrix, np.array(quaternion, float))
    return matrix.reshape(3, 3)


def quaternion_of(rotation: Array) -> Array:
    """The quaternion (4,) of a rotation matrix (3, 3)."""
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, rotation.flatten())
    return quaternion
