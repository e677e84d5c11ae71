"""A robot as it knows itself: by its encoders, and a model that may be wrong."""

import copy
from typing import final

import mujoco
import numpy as np

from sim.believed import BelievedConfig
from sim.camera.renderer import VISION_FROM_MUJOCO
from sim.geometry import log_se3
from sim.models.quaternion import matrix_of, quaternion_of
from sim.ranges import EachJoint
from sim.robot.design import CAMERA, Design
from sim.robot.robot import Robot
from sim.types import Array, Pose, Posture


@final
class KnownRobot:
    """A robot that computes from its encoders and its own, maybe wrong, model. Its joints
    have play.

    The play is kinematic: the motor, where the encoder is, turns freely by `backlash` when it
    reverses, and the joint stands meanwhile, as friction would hold it. Inside the play nothing
    swings or hits.
    """

    def __init__(
        self, robot: Robot, design: Design, believed: BelievedConfig, rng: np.random.Generator
    ) -> None:
        """Begin with the motors in the middle of their play.

        Raises:
            ValueError: A setting has another number of values than the robot has joints.
        """
        self._true = robot
        self._rng = rng
        model = copy.copy(robot.model)
        self._robot = Robot(model, design)
        self._data = mujoco.MjData(model)
        _move_site(model, believed.hand_eye)
        drives = design.drives
        names = robot.names
        self._offsets = each_joint("believed.joint_offsets", believed.joint_offsets, names)
        self._noise = each_joint("robot.encoder_noise", drives.encoder_noise, names)
        self._step = each_joint("robot.encoder_step", drives.encoder_step, names)
        self._slack = each_joint("robot.backlash", drives.backlash, names) / 2
        self._play = np.zeros(len(names))
        self._last: tuple[float, Pose] | None = None

    def rates(self, data: mujoco.MjData, twist: Array, hold: float) -> tuple[Array, bool]:
        """As `Robot.rates`, for the believed camera."""
        self._read(data)
        return self._robot.rates(self._data, twist, hold)

    def jacobian(self, data: mujoco.MjData) -> Array:
        """The believed one, as of the last reading."""
        del data
        return self._robot.jacobian(self._data)

    def driven(self, rates: Array, hold: float) -> Array:
        """Return the joints' rates (n,) over a time [s]: the motors', less the play."""
        if not self._slack.any():
            return rates
        before = self._play
        self._play = np.clip(before + rates * hold, -self._slack, self._slack)
        return rates - (self._play - before) / hold

    def posture(self, data: mujoco.MjData, accepted: Array | None) -> Posture:
        """Return the posture by the encoders; its twist is the mean since the last one."""
        self._read(data)
        eye = self._robot.eye(self._data)
        twist = np.zeros(6)
        if self._last is not None and data.time > self._last[0]:
            time, before = self._last
            twist = log_se3(before.inverse() @ eye) / (data.time - time)
        self._last = float(data.time), eye
        return self._robot.posture(self._data, twist, accepted)

    def _read(self, data: mujoco.MjData) -> None:
        """Put the robot's own model where its encoders say that it is."""
        q = self._true.joints(data) + self._play
        if self._noise.any():
            q += self._rng.normal(0.0, self._noise)
        stepped = self._step > 0
        q[stepped] = np.rint(q[stepped] / self._step[stepped]) * self._step[stepped]
        self._data.qpos[:] = data.qpos
        self._data.qpos[self._robot.qpos] = q + self._offsets
        mujoco.mj_kinematics(self._robot.model, self._data)
        mujoco.mj_comPos(self._robot.model, self._data)


def as_known(
    robot: Robot, design: Design, believed: BelievedConfig, rng: np.random.Generator | None
) -> Robot | KnownRobot:
    """A robot as it knows itself: the same object where it knows all of itself as it is."""
    d = design.drives
    errors = [np.ravel(each) for each in (d.encoder_noise, d.encoder_step, d.backlash)]
    if believed.is_body_right and not np.concatenate(errors).any():
        return robot
    return KnownRobot(robot, design, believed, rng or np.random.default_rng(0))


def each_joint(setting: str, given: EachJoint, names: tuple[str, ...]) -> Array:
    """The values (n,) of a setting that has one for all joints, or one for each.

    Raises:
        ValueError: It has another number of values.
    """
    values = np.ravel(given).astype(np.float64)
    if len(values) not in (1, len(names)):
        raise ValueError(
            f"{setting} has {len(values)} values; it should have one, or {len(names)} for "
            f"{', '.join(names)}"
        )
    return np.broadcast_to(values, len(names)).copy()


def _move_site(model: mujoco.MjModel, T_camera_believed: Pose) -> None:
    """Put the camera's site of a model, by which a `Robot` computes, elsewhere on its body."""
    site = model.site(CAMERA).id
    R = matrix_of(model.site_quat[site]) @ VISION_FROM_MUJOCO
    model.site_pos[site] += R @ T_camera_believed.translation
    moved = R @ T_camera_believed.rotation @ VISION_FROM_MUJOCO.T
    model.site_quat[site] = quaternion_of(moved)
    model.site_sameframe[site] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE
