"""Calibration errors, and a robot that computes with a wrong model of itself."""

import copy
from dataclasses import dataclass, replace
from typing import Annotated, Literal, final

import mujoco
import numpy as np
from annotated_types import Ge, Le

from sim.geometry import exp_so3, log_se3
from sim.kinematics.robot import Design, Robot, each_joint
from sim.ranges import Degrees, EachJoint
from sim.types import Array, Camera, Pose, Posture

Shift = Annotated[float, Ge(-10_000), Le(10_000)]
Millimetres = Annotated[float, Ge(-1000), Le(1000)]


@dataclass(frozen=True, slots=True)
class BelievedConfig:
    """Errors of the calibration that the robot relies on; by default it has none.

    Factors are believed over true values; shifts and offsets are believed minus true ones. The
    principal point is in px, the hand-eye rotation a rotation vector [deg] and its translation [mm]
    in the true camera's frame, joint offsets in m or rad, the clock in ms. `goal` tells how the
    robot knows the goal: "computed" with the believed camera, "shown" as corners by the true camera
    at the true goal, or as the target's "pose" there.
    """

    fx_factor: Annotated[float, Ge(0.1), Le(10)] = 1.0
    """Believed over true focal length, along u and v."""
    cx_shift: Shift = 0.0
    """The principal point is believed this far to the right of the true one [px]."""
    cy_shift: Shift = 0.0
    """The principal point is believed this far below the true one [px]."""
    ignore_distortion: bool = False
    """The camera is taken for a pinhole."""
    goal: Literal["computed", "shown", "pose"] = "computed"
    """How the goal is known: "computed", its centre in pixels, its size from the believed camera;
    "shown", the corners that the true camera sees at the true goal; or "pose", the target's pose in
    the camera at the true goal [m]."""
    hand_eye_rotation_deg: tuple[Degrees, Degrees, Degrees] = (0.0, 0.0, 0.0)
    """Orientation of the believed camera in the true one (x right, y down, z forward), a rotation
    vector [deg]; of a camera in the room, too."""
    hand_eye_mm: tuple[Millimetres, Millimetres, Millimetres] = (0.0, 0.0, 0.0)
    """Position of the believed camera in the true one [mm]."""
    joint_offsets: EachJoint = 0.0
    """Believed minus true joint positions, one for all or one each [m or rad]."""
    clock_offset_ms: Annotated[float, Ge(-60_000), Le(60_000)] = 0.0
    """A picture's time stamp minus its true time [ms]: the robot pairs the picture with its posture
    at the time of the stamp, or with its newest posture.
    """
    depth_factor: Annotated[float, Ge(0.01), Le(100)] = 1.0
    """Depth in the interaction matrix of moments, points and segments, over the true depth: the
    gain of translations is wrong by the same factor.
    """
    size_factor: Annotated[float, Ge(0.01), Le(100)] = 1.0
    """Believed over true length of the target's sides: the camera then ends too near or too far,
    except with sight.depth = "picture".
    """

    def __post_init__(self) -> None:
        if self.size_factor != 1.0 and self.goal == "shown":
            raise ValueError('size_factor has no effect with goal = "shown": leave size_factor out')

    def camera(self, camera: Camera) -> Camera:
        """Return the intrinsics [px] that the robot believes a camera to have, given the true ones;
        the given object itself if the robot's belief is right.
        """
        f = self.fx_factor
        believed = replace(
            camera,
            fx=camera.fx * f,
            fy=camera.fy * f,
            cx=camera.cx + self.cx_shift,
            cy=camera.cy + self.cy_shift,
            distortion=None if self.ignore_distortion else camera.distortion,
        )
        return camera if believed == camera else believed

    def outline(self, outline: Array) -> Array:
        """Return the corners (4, 3) [m], in the target's frame, that the robot believes a target's
        reference rectangle to have, given the true corners: scaled by `size_factor` about their
        centre.
        """
        middle = outline.mean(axis=0)
        f = self.size_factor
        return outline if f == 1.0 else middle + f * (outline - middle)

    @property
    def hand_eye(self) -> Pose:
        """The hand-eye error T_camera_believed: the pose of the believed camera in the true
        camera's frame.
        """
        turn = exp_so3(np.radians(self.hand_eye_rotation_deg))
        return Pose(turn, np.array(self.hand_eye_mm) / 1e3)

    @property
    def is_body_right(self) -> bool:
        """True if these settings give no error to the hand-eye pose and none to the joint
        positions.
        """
        errors = *self.hand_eye_rotation_deg, *self.hand_eye_mm, *np.ravel(self.joint_offsets)
        return not any(errors)


RIGHT = BelievedConfig()
"""A calibration without errors."""


@final
class BelievedRobot:
    """A robot that computes its kinematics from encoder readings, whose noise `rng` draws, and from
    a model of itself with calibration errors, and whose joints have backlash. It takes the place of
    the exact `robot` in a simulation.

    The backlash is kinematic: a motor that reverses turns freely by `backlash`, with its encoder,
    and the joint stands meanwhile, as friction would hold it. Inside the backlash nothing swings or
    hits.
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
        # Only now: a robot is refused whose site is not where its camera is.
        self._robot.mounting = design.mounting.believed(model, believed.hand_eye)
        self._data = mujoco.MjData(model)
        names = robot.names
        self._offsets = each_joint("believed.joint_offsets", believed.joint_offsets, names)
        self._noise = each_joint("robot.encoder_noise", design.drives.encoder_noise, names)
        self._step = each_joint("robot.encoder_step", design.drives.encoder_step, names)
        self._slack = each_joint("robot.backlash", design.drives.backlash, names) / 2
        self._play = np.zeros(len(names))
        self._last: tuple[float, Pose] | None = None

    def rates(
        self, data: mujoco.MjData, twist: Array, hold: float, before: Array
    ) -> tuple[Array, Array, tuple[str, ...]]:
        """Return the joint rates (n,) [m/s or rad/s] for a commanded camera twist, the camera twist
        (6,) that the robot believes these rates to make, and the joints whose limits changed the
        commanded twist, such as "elbow (range)".

        All is computed by the robot's wrong model of itself; joints that really stand at an end of
        their range are added to those with limits.

        Args:
            data: MuJoCo's state, with the true joint positions.
            twist: The commanded twist (6,) in the camera frame [m/s, rad/s].
            hold: Time for which the rates hold [s].
            before: The rates (n,) before these [m/s or rad/s], for acceleration limits.
        """
        self._read(data)
        rates, made, limits = self._robot.rates(self._data, twist, hold, before)
        return rates, made, (*limits, *self._true.stopped(data, rates))

    def driven(self, rates: Array, hold: float) -> Array:
        """Return the joint rates (n,) [m/s or rad/s] that result if the motors have the given rates
        for a time `hold` [s]: reduced by the motion that the backlash takes up. The positions of
        the motors inside the backlash are stored for the next call.
        """
        if not self._slack.any():
            return rates
        before = self._play
        self._play = np.clip(before + rates * hold, -self._slack, self._slack)
        return rates - (self._play - before) / hold

    def posture(self, data: mujoco.MjData, accepted: Array | None) -> Posture:
        """Return the posture (camera pose, joint positions, Jacobian, twists) that the robot
        computes from its encoders and its wrong model of itself. Its measured twist is the mean
        since the last call of this method, zero at the first. Encoder noise is drawn at each call.

        Args:
            data: MuJoCo's state, with the true joint positions.
            accepted: Mean camera twist (6,) that the drives were set to since the last frame, in
                the camera frame [m/s, rad/s]; None: unknown.
        """
        self._read(data)
        eye = self._robot.eye(self._data)
        twist = np.zeros(6)
        if self._last is not None and data.time > self._last[0]:
            time, before = self._last
            twist = log_se3(before.inverse() @ eye) / (data.time - time)
        self._last = float(data.time), eye
        return self._robot.posture(self._data, twist, accepted)

    def _read(self, data: mujoco.MjData) -> None:
        """Set the state of the robot's wrong model to the joint positions that the encoders read,
        with their noise and offsets.
        """
        q = self._true.joints(data) + self._play
        if self._noise.any():
            q += self._rng.normal(0.0, self._noise)
        stepped = self._step > 0
        q[stepped] = np.rint(q[stepped] / self._step[stepped]) * self._step[stepped]
        self._data.qpos[:] = data.qpos
        self._data.qpos[self._robot.qpos] = q + self._offsets
        self._robot.refresh(self._data)


def as_believed(
    robot: Robot, design: Design, believed: BelievedConfig, rng: np.random.Generator | None
) -> Robot | BelievedRobot:
    """Return a robot with the errors of the hand-eye pose and of the joint positions that
    `believed` gives, and with the encoder errors and the backlash of the drives of `design`; the
    given robot itself if all of these are zero. Other errors in `believed`, such as those of the
    camera's intrinsics, have no effect here. `rng` draws the noise of the encoders (None: a
    generator with seed 0).
    """
    d = design.drives
    errors = [np.ravel(each) for each in (d.encoder_noise, d.encoder_step, d.backlash)]
    if believed.is_body_right and not np.concatenate(errors).any():
        return robot
    return BelievedRobot(robot, design, believed, rng or np.random.default_rng(0))
