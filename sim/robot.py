"""A robot that carries the camera: camera twist to joint rates, for any chain of velocity-driven
joints.

Nothing here knows which robot it is: joints, limits and actuators come from the MJCF model, in
which every actuator is a `velocity` servo named like the joint it drives, and the camera's optical
centre is the site `eye`.
"""

# pyright: reportAttributeAccessIssue=false
# MuJoCo's names come from compiled modules without stubs.
from __future__ import annotations

import mujoco
import numpy as np

from sim.geometry import log_se3
from sim.render import VISION_FROM_MUJOCO
from sim.types import Array, Pose

EYE = "eye"
DAMPING = 1e-3
"""Damping of the pseudo-inverse: bounds the rates near a singular pose and is invisible elsewhere.
"""
STOP_GAIN = 8.0
"""Largest rate towards a joint limit, per unit of room left [1/s]."""
STOP_MARGIN = 0.01
"""Room that is kept before a joint limit [m or rad]."""
SOLVE_STEPS, SOLVE_TOLERANCE = 200, 1e-10


class Robot:
    """The chain of joints between the world and the camera."""

    def __init__(self, model: mujoco.MjModel) -> None:
        self._model = model
        self._site = model.site(EYE).id
        joints = model.actuator_trnid[:, 0]
        self.names = tuple(model.joint(j).name for j in joints)
        slides = model.jnt_type[joints] == mujoco.mjtJoint.mjJNT_SLIDE
        self.units = tuple("m" if slide else "rad" for slide in slides)
        self._qpos = model.jnt_qposadr[joints]
        self._dof = model.jnt_dofadr[joints]
        limited = model.jnt_limited[joints].astype(bool)
        self.lower = np.where(limited, model.jnt_range[joints, 0], -np.inf)
        self.upper = np.where(limited, model.jnt_range[joints, 1], np.inf)
        self.fastest = model.actuator_ctrlrange[:, 1].copy()

    def joints(self, data: mujoco.MjData) -> Array:
        """Joint positions (n,) [m or rad]."""
        return data.qpos[self._qpos].copy()

    def rates_measured(self, data: mujoco.MjData) -> Array:
        """Joint velocities (n,) [m/s or rad/s]."""
        return data.qvel[self._dof].copy()

    def jacobian(self, data: mujoco.MjData) -> Array:
        """Camera twist in the camera (vision) frame per joint rate (6, n), as of the last
        kinematics.
        """
        linear, angular = np.zeros((3, self._model.nv)), np.zeros((3, self._model.nv))
        mujoco.mj_jacSite(self._model, data, linear, angular, self._site)
        R_camera_world = (data.site_xmat[self._site].reshape(3, 3) @ VISION_FROM_MUJOCO).T
        return np.vstack([R_camera_world @ linear, R_camera_world @ angular])[:, self._dof]

    def rates(self, data: mujoco.MjData, twist: Array) -> tuple[Array, bool]:
        """Joint rates (n,) for a camera twist (6,), and whether a limit made the whole motion
        slower.

        One factor slows all joints, so that a saturated camera still moves in the direction asked
        for.
        """
        J = self.jacobian(data)
        wanted = J.T @ np.linalg.solve(J @ J.T + DAMPING**2 * np.eye(6), twist)
        q = data.qpos[self._qpos]
        most = np.minimum(self.fastest, STOP_GAIN * np.maximum(self.upper - STOP_MARGIN - q, 0.0))
        least = np.maximum(
            -self.fastest, -STOP_GAIN * np.maximum(q - self.lower - STOP_MARGIN, 0.0)
        )
        bound = np.where(wanted > 0, most, least)
        over = np.abs(wanted) > np.abs(bound)
        if not over.any():
            return wanted, False
        return wanted * np.min(np.abs(bound[over]) / np.abs(wanted[over])), True

    def solve(self, data: mujoco.MjData, T_world_camera: Pose) -> bool:
        """Set the joints so that the camera takes this pose; whether the limits allow it."""
        for _ in range(SOLVE_STEPS):
            error = log_se3(self._pose(data).inverse() @ T_world_camera)
            if np.linalg.norm(error) < SOLVE_TOLERANCE:
                q = data.qpos[self._qpos]
                return bool(np.all((q >= self.lower) & (q <= self.upper)))
            J = self.jacobian(data)
            data.qpos[self._qpos] += J.T @ np.linalg.solve(J @ J.T + DAMPING**2 * np.eye(6), error)
        return False

    def _pose(self, data: mujoco.MjData) -> Pose:
        mujoco.mj_kinematics(self._model, data)
        mujoco.mj_comPos(self._model, data)
        rotation = data.site_xmat[self._site].reshape(3, 3) @ VISION_FROM_MUJOCO
        return Pose(rotation, data.site_xpos[self._site].copy())
