"""A robot that carries the camera: camera twist to joint rates, for any chain of velocity-driven
joints.

Nothing here knows which robot it is: joints, limits and actuators come from its model. There every
actuator is a `velocity` servo of one joint, and the camera's optical centre is the site `eye`. A
model that is built otherwise is refused: its robot would move, but not as it is asked to.
"""

import mujoco
import numpy as np

from sim.camera.renderer import VISION_FROM_MUJOCO
from sim.geometry import exp_se3, inverse_if_strong
from sim.robot.design import CAMERA, EYE, Design, Inversion
from sim.robot.drives import wrong_drive
from sim.robot.start_pose import Reach, iterate, reach
from sim.types import Array, Pose, Posture

STOP_GAIN = 8.0
"""Largest rate towards a joint limit, per unit of room left [1/s]."""
STOP_MARGIN = 0.01
"""Room that is kept before a joint limit [m or rad]."""


def own_name(name: str) -> str:
    """A name as the robot's own model has it."""
    return name.removeprefix("robot/")


def damped_inverse(J: Array, inversion: Inversion) -> Array:
    """The inverse (n, 6) of a Jacobian (6, n), damped near singular poses.

    After Nakamura and Hanafusa 1986: with s the smallest singular value and e = `weakest`,
    lambda^2 = damping^2 (1 - (s / e)^2) where s < e, else zero; s_i becomes s_i / (s_i^2 +
    lambda^2).
    """
    if (
        J.shape[0] == J.shape[1]
        and (inverse := inverse_if_strong(J, inversion.weakest)) is not None
    ):
        return inverse
    U, s, Vt = np.linalg.svd(J, full_matrices=False)
    missing = max(0.0, 1.0 - (s[-1] / inversion.weakest) ** 2)
    return (Vt.T * (s / (s**2 + missing * inversion.damping**2))) @ U.T


def _check_drives(model: mujoco.MjModel, design: Design) -> None:
    """Refuse actuators that are no velocity servos, and an optical centre away from the camera."""
    place = f"the robot's model {design.name}"
    if model.nu == 0:
        raise ValueError(f"{place} has no actuators; each joint needs a velocity actuator")
    for i in range(model.nu):
        if (wrong := wrong_drive(model, i)) is not None:
            raise ValueError(f"{place}: the actuator '{own_name(model.actuator(i).name)}' {wrong}")
    eye = model.site(CAMERA)
    camera = model.camera(CAMERA)
    same = np.allclose([*eye.pos, *eye.quat], [*camera.pos, *camera.quat], atol=1e-9)
    if eye.bodyid != camera.bodyid or not same:
        raise ValueError(f"{place}: the site '{EYE}' has to be where the camera '{EYE}' is")


class Robot:
    """The chain of joints between the world and the camera."""

    def __init__(self, model: mujoco.MjModel, design: Design) -> None:
        """Read the joints and their drives from a model.

        Raises:
            ValueError: The model is no robot of this kind; the message says what is wrong.
        """
        _check_drives(model, design)
        self.model = model
        self._homes = design.homes
        self._inversion = design.inversion
        self._site = model.site(CAMERA).id
        self.ids = joints = model.actuator_trnid[:, 0]
        self.names = tuple(own_name(model.joint(j).name) for j in joints)
        slides = model.jnt_type[joints] == mujoco.mjtJoint.mjJNT_SLIDE
        self.units = tuple("m" if slide else "rad" for slide in slides)
        self.qpos = model.jnt_qposadr[joints]
        self._dof = model.jnt_dofadr[joints]
        limited = model.jnt_limited[joints].astype(bool)
        self.lower = np.where(limited, model.jnt_range[joints, 0], -np.inf)
        self.upper = np.where(limited, model.jnt_range[joints, 1], np.inf)
        bounded = model.actuator_ctrllimited.astype(bool)[:, None]
        rates = np.where(bounded, model.actuator_ctrlrange, [-np.inf, np.inf])
        self.slowest, self.fastest = rates.T
        stops = self.lower + STOP_MARGIN, self.upper - STOP_MARGIN
        self._limited = limited
        self._freedom = len(joints) > 6
        self._middles = np.where(limited, model.jnt_range[joints].mean(axis=1), 0.0)
        self._bounds = [bound.tolist() for bound in (*stops, self.slowest, self.fastest)]
        self._jacobians = np.zeros((2, 3, model.nv))
        self._ahead = mujoco.MjData(model)

    def posture(self, data: mujoco.MjData, twist: Array, accepted: Array | None = None) -> Posture:
        """Return what the robot knows of itself, as of the last kinematics.

        Args:
            data: Where the joints are.
            twist: Mean camera twist (6,) since the last frame.
            accepted: Mean camera twist (6,) that the drives were set to.
        """
        J = self.jacobian(data)
        joints = self.joints(data)
        return Posture(
            self.eye(data),
            twist,
            joints,
            self.lower,
            self.upper,
            J,
            self.slowest,
            self.fastest,
            accepted,
        )

    def joints(self, data: mujoco.MjData) -> Array:
        """Joint positions (n,) [m or rad]."""
        return data.qpos[self.qpos].copy()

    def rates_measured(self, data: mujoco.MjData) -> Array:
        """Joint velocities (n,) [m/s or rad/s]."""
        return data.qvel[self._dof].copy()

    def jacobian(self, data: mujoco.MjData) -> Array:
        """Camera twist in the camera (vision) frame per joint rate (6, n), as of the last
        kinematics.
        """
        linear, angular = self._jacobians
        mujoco.mj_jacSite(self.model, data, linear, angular, self._site)
        R_camera_world = (data.site_xmat[self._site].reshape(3, 3) @ VISION_FROM_MUJOCO).T
        return (R_camera_world @ self._jacobians).reshape(6, -1)[:, self._dof]

    def rates(self, data: mujoco.MjData, twist: Array, hold: float = 0.0) -> tuple[Array, bool]:
        """Joint rates (n,) for a camera twist (6,), and whether a limit made the whole motion
        slower.

        One factor slows all joints, so that a saturated camera still moves in the direction asked
        for.

        Args:
            data: Where the joints are.
            twist: What is asked for.
            hold: How long the rates hold [s], for drives that are exact.
        """
        J = self.jacobian(data)
        exact = self._exact(data, twist, hold) if self._inversion.exact and hold else None
        wanted = damped_inverse(J, self._inversion) @ twist if exact is None else exact
        if self._freedom and exact is None:
            centred = wanted + self._centring(data, J)
            if self._slowed(data, centred) == 1.0:
                return centred, False
        factor = self._slowed(data, wanted)
        return wanted * factor, factor < 1.0

    def driven(self, rates: Array, hold: float) -> Array:
        """Return the rates (n,) of joints that are driven at these for a time [s]: the same."""
        del hold
        return rates

    def _exact(self, data: mujoco.MjData, twist: Array, hold: float) -> Array | None:
        """The rates (n,) that make the whole motion in this time; None where no joints do."""
        q = self.joints(data)
        ahead = self._ahead
        ahead.qpos[:] = data.qpos
        mujoco.mj_kinematics(self.model, ahead)
        there = iterate(self, ahead, q, self.eye(ahead) @ exp_se3(twist * hold))
        return (self.joints(ahead) - q) / hold if there else None

    def _slowed(self, data: mujoco.MjData, wanted: Array) -> float:
        """The factor on all rates with which no joint is too fast."""
        factor = 1.0
        # A few joints: Python is faster here than arrays.
        joints = zip(wanted.tolist(), data.qpos[self.qpos].tolist(), *self._bounds, strict=True)
        for rate, q, lower, upper, slowest, fastest in joints:
            room, most = (upper - q, fastest) if rate > 0 else (q - lower, -slowest)
            most = min(most, STOP_GAIN * max(room, 0.0))
            if abs(rate) > most:
                factor = min(factor, most / abs(rate))
        return factor

    def _centring(self, data: mujoco.MjData, J: Array) -> Array:
        """Rates (n,) towards the middles between the limits that do not move the camera.

        After Liegeois 1977 (Automatic supervisory control of the configuration and behavior of
        multibody mechanisms, IEEE Trans. SMC 7): the gradient of the squared distances from the
        middles, projected into the null space of the Jacobian.
        """
        away = np.where(self._limited, data.qpos[self.qpos] - self._middles, 0.0)
        free = -self._inversion.centring * away
        return free - np.linalg.pinv(J) @ (J @ free)

    def solve(self, data: mujoco.MjData, T_world_camera: Pose) -> Reach:
        """Set the joints so that the camera takes this pose, or comes near it; how near."""
        return reach(self, data, self._homes, T_world_camera)

    def eye(self, data: mujoco.MjData) -> Pose:
        """T_world_camera, as of the last kinematics."""
        rotation = data.site_xmat[self._site].reshape(3, 3) @ VISION_FROM_MUJOCO
        return Pose(rotation, data.site_xpos[self._site].copy())
