"""A robot that carries the camera: its design, and camera twist to joint rates, for any chain of
velocity-driven joints.

Nothing here knows which robot it is: joints, limits and actuators come from its model. There every
actuator is a `velocity` servo of one joint, and the camera's optical centre is the site `eye`. A
model that is built otherwise is refused: its robot would move, but not as it is asked to.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Annotated

import daqp
import mujoco
import numpy as np
from annotated_types import Ge, Le

from sim.camera.renderer import VISION_FROM_MUJOCO
from sim.geometry import adjoint, angle_of, exp_se3, inverse_if_strong, log_se3
from sim.kinematics.chain import ALL_WAYS
from sim.kinematics.drives import wrong_drive
from sim.ranges import EachPlay
from sim.types import Array, Pose, Posture

EYE = "eye"
"""Name of the camera in a robot's model, and of the site in its optical centre."""
CAMERA = f"robot/{EYE}"
"""Their name in the scene."""
STOP_GAIN = 8.0
"""Largest rate towards a joint limit, per unit of room left [1/s]."""
STOP_MARGIN = 0.01
"""Room that is kept before a joint limit [m or rad]."""
STEPS = 200
TOLERANCE = 1e-10
DAMPING = 1e-3
"""Steps of Newton's method, the error at which it ends [m, rad], which leaves starts exact to
rounding, and its damping; chosen by hand."""
SECOND_TASK = 1e-8
"""Weight of rates that are liked against the camera's twist: the twist then errs by less than
`EXACT` wherever the arm is not near a singular pose."""
EXACT = 1e-4
"""A twist that differs by less than this [m/s, rad/s] is the one asked for."""
UNLIMITED = 1e6
"""A rate that no joint has: DAQP takes no infinities."""
HALF_TURN = np.pi - 1e-5
"""Angle beyond which a rotation has no clear axis, and Newton's method no direction [rad]."""


@dataclass(frozen=True, slots=True)
class Drives:
    """Errors of a robot's drives and encoders."""

    encoder_noise: EachPlay = 0.0
    """Standard deviation of each reading of a joint, one for all or one each [m or rad]."""
    encoder_step: EachPlay = 0.0
    """Joints are read in whole steps of this, one for all or one each [m or rad]."""
    backlash: EachPlay = 0.0
    """Play between motor and joint, one for all or one each [m or rad]: a motor that reverses turns
    so far, and its encoder with it, until the joint follows."""
    lag_ms: Annotated[float, Ge(0), Le(1000)] = 0.0
    """Time constant with which a drive takes over a new rate, before its own servo [ms]."""


@dataclass(frozen=True, slots=True)
class Inversion:
    """The way from a camera twist to joint rates."""

    weakest: float = 0.02
    """Below this smallest singular value of the Jacobian [m/s or rad/s of the camera per unit of
    joint rate] the inverse is damped."""
    damping: float = 0.02
    """Damping in a singular pose; the camera then moves less than asked for, and another way."""
    centring: float = 1.0
    """With more than six joints: how fast those with limits move towards the middle between them
    [1/s], as far as this does not move the camera (Liegeois 1977)."""
    exact: bool = False
    """Take the rates that bring the camera exactly to where the twist leads by the next update of
    the drives; otherwise those that the twist needs at the beginning are held until then."""


@dataclass(frozen=True, slots=True)
class EyeToHand:
    """A camera that stands in the room, and a target in the robot's hand: at the site `eye`."""

    T_world_camera: Pose
    """Where the camera stands (x right, y down, z forward)."""
    T_hand_target: Pose
    """How the robot holds the target."""


@dataclass(frozen=True, slots=True)
class Design:
    """A robot before it is put into the room."""

    name: str
    """Name of its model in messages, such as "gantry.xml"."""
    spec: mujoco.MjSpec
    """Its model, with a camera and a site `eye`, and one velocity actuator for each joint."""
    drives: Drives
    """Errors of its drives and encoders."""
    homes: tuple[tuple[float, ...], ...]
    """Joint positions from which all others are sought, one after another [m or rad]; where there
    are none, from everywhere."""
    base: Pose = field(default_factory=lambda: Pose.planar(0.0, 0.0, 0.0))
    """T_room_base: where it stands; the room's z is up, and the table's top at z = 0."""
    inversion: Inversion = Inversion()
    """How its joints follow a camera twist."""
    eye_to_hand: EyeToHand | None = None
    """Where the camera stands, if the robot carries the target in its place."""


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
    if design.eye_to_hand is not None:
        return  # the camera is elsewhere
    eye = model.site(CAMERA)
    camera = model.camera(CAMERA)
    same = np.allclose([*eye.pos, *eye.quat], [*camera.pos, *camera.quat], atol=1e-9)
    if eye.bodyid != camera.bodyid or not same:
        raise ValueError(f"{place}: the site '{EYE}' has to be where the camera '{EYE}' is")


class Robot:
    """The chain of joints between the world and the camera.

    Where the robot holds the target and the camera stands, poses and twists are the camera's as
    they are seen from the target: moving the target by a twist moves the camera, seen from it, by
    the opposite one. All that holds for a camera in the hand then holds for it too.
    """

    def __init__(self, model: mujoco.MjModel, design: Design) -> None:
        """Read the joints and their drives from a model.

        Raises:
            ValueError: The model is no robot of this kind; the message says what is wrong.
        """
        _check_drives(model, design)
        self.model = model
        self.homes = design.homes
        self._inversion = design.inversion
        self._eye_to_hand = design.eye_to_hand
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
        self._freedom = len(joints) > ALL_WAYS
        self._middles = np.where(limited, model.jnt_range[joints].mean(axis=1), 0.0)
        self._bounds = [bound.tolist() for bound in (*stops, self.slowest, self.fastest)]
        self._jacobians = np.zeros((2, 3, model.nv))
        self._ahead = mujoco.MjData(model)

    def servos(self) -> Array:
        """Return the time constants of the drives' own servos (n,) [s], for implicit steps."""
        model = self.model
        at = model.jnt_dofadr[self.ids]
        strength = model.actuator_gainprm[:, 0] + model.dof_damping[at]
        step = model.opt.timestep
        return step / np.log1p(step * strength / model.dof_M0[at])

    def posture(self, data: mujoco.MjData, twist: Array, accepted: Array | None = None) -> Posture:
        """Return what the robot knows of itself, as of the last kinematics.

        Args:
            data: Where the joints are.
            twist: Mean camera twist (6,) since the last frame.
            accepted: Mean camera twist (6,) that the drives were set to.
        """
        return Posture(
            self.eye(data),
            twist,
            self.joints(data),
            self.lower,
            self.upper,
            self.jacobian(data),
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

        With the camera in the room: -V J, where J gives the hand's twist and V takes it to the
        camera's frame.
        """
        linear, angular = self._jacobians
        mujoco.mj_jacSite(self.model, data, linear, angular, self._site)
        R_camera_world = (data.site_xmat[self._site].reshape(3, 3) @ VISION_FROM_MUJOCO).T
        J = (R_camera_world @ self._jacobians).reshape(6, -1)[:, self._dof]
        if self._eye_to_hand is None:
            return J
        return -adjoint(self._eye_to_hand.T_world_camera.inverse() @ self.hand(data)) @ J

    def rates(
        self, data: mujoco.MjData, twist: Array, hold: float = 0.0
    ) -> tuple[Array, Array, bool]:
        """Joint rates (n,) for a camera twist (6,), the twist (6,) that they make, and whether a
        limit made the whole motion slower.

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
                return centred, J @ centred, False
            within = self._within_limits(data, J, twist, centred)
            made = J @ within
            if np.abs(made - J @ wanted).max() < EXACT:
                return within, made, False
        factor = self._slowed(data, wanted)
        slowed = wanted * factor
        return slowed, J @ slowed, factor < 1.0

    def driven(self, rates: Array, hold: float) -> Array:
        """Return the rates (n,) of joints that are driven at these for a time [s]: the same."""
        return rates

    def _exact(self, data: mujoco.MjData, twist: Array, hold: float) -> Array | None:
        """The rates (n,) that make the whole motion in this time; None where no joints do."""
        q = self.joints(data)
        ahead = self._ahead
        ahead.qpos[:] = data.qpos
        mujoco.mj_kinematics(self.model, ahead)
        there = self.converge(ahead, q, self.eye(ahead) @ exp_se3(twist * hold))
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

    def _within_limits(self, data: mujoco.MjData, J: Array, twist: Array, liked: Array) -> Array:
        """Return the rates (n,) inside the limits of all joints whose camera twist is nearest to
        the one asked for, and of those the ones nearest to some rates that are liked.

        A quadratic programme, solved by DAQP (Arnstrom, Bemporad and Axehill, A dual active-set
        solver for embedded quadratic programming using recursive LDL^T updates, IEEE TAC 2022).
        """
        low, high, slowest, fastest = map(np.array, self._bounds)
        q = data.qpos[self.qpos]
        upper = np.minimum(fastest, STOP_GAIN * np.maximum(high - q, 0.0))
        lower = np.maximum(slowest, -STOP_GAIN * np.maximum(q - low, 0.0))
        n = len(q)
        H = J.T @ J + SECOND_TASK * np.eye(n)
        f = -(J.T @ twist + SECOND_TASK * liked)
        none = np.zeros((0, n))
        limits = np.clip(upper, -UNLIMITED, UNLIMITED), np.clip(lower, -UNLIMITED, UNLIMITED)
        found, _, _, _ = daqp.solve(H, f, none, *limits, np.zeros(n, np.intc))
        return found

    def _centring(self, data: mujoco.MjData, J: Array) -> Array:
        """Rates (n,) towards the middles between the limits that do not move the camera.

        After Liegeois 1977 (Automatic supervisory control of the configuration and behavior of
        multibody mechanisms, IEEE Trans. SMC 7): the gradient of the squared distances from the
        middles, projected into the null space of the Jacobian.
        """
        away = np.where(self._limited, data.qpos[self.qpos] - self._middles, 0.0)
        free = -self._inversion.centring * away
        return free - np.linalg.pinv(J) @ (J @ free)

    def converge(
        self, data: mujoco.MjData, begin: Sequence[float] | Array, T_world_camera: Pose
    ) -> bool:
        """Run Newton's method, damped, from one place; True where it ends inside the limits.

        Args:
            data: What is set; the camera then has the pose, or is anywhere.
            begin: Joint positions (n,) [m or rad].
            T_world_camera: The pose.
        """
        data.qpos[self.qpos] = begin
        for _ in range(STEPS):
            self.refresh(data)
            left = self.eye(data).inverse() @ T_world_camera
            if angle_of(left.rotation) > HALF_TURN:
                return False
            error = log_se3(left)
            if np.linalg.norm(error) < TOLERANCE:
                q = data.qpos[self.qpos]
                return bool(np.all((q >= self.lower) & (q <= self.upper)))
            J = self.jacobian(data)
            damped = J @ J.T + DAMPING**2 * np.eye(6)
            data.qpos[self.qpos] += J.T @ np.linalg.solve(damped, error)
        return False

    def refresh(self, data: mujoco.MjData) -> None:
        """Compute the kinematics of where the joints are."""
        mujoco.mj_kinematics(self.model, data)
        mujoco.mj_comPos(self.model, data)

    def eye(self, data: mujoco.MjData) -> Pose:
        """T_world_camera, or T_target_camera where the robot holds the target, as of the last
        kinematics.
        """
        stands = self._eye_to_hand
        if stands is None:
            return self.hand(data)
        return self.held(data, stands).inverse() @ stands.T_world_camera

    def held(self, data: mujoco.MjData, stands: EyeToHand) -> Pose:
        """T_world_target of a target in the hand, as of the last kinematics."""
        return self.hand(data) @ stands.T_hand_target

    def hand_for(self, eye: Pose) -> Pose:
        """T_world_hand with which `eye` is this pose."""
        stands = self._eye_to_hand
        if stands is None:
            return eye
        return stands.T_world_camera @ eye.inverse() @ stands.T_hand_target.inverse()

    def camera(self, data: mujoco.MjData) -> Pose:
        """T_world_camera, as of the last kinematics."""
        return self.hand(data) if self._eye_to_hand is None else self._eye_to_hand.T_world_camera

    def hand(self, data: mujoco.MjData) -> Pose:
        """T_world_hand: of the site `eye` (x right, y down, z forward), as of the last
        kinematics.
        """
        rotation = data.site_xmat[self._site].reshape(3, 3) @ VISION_FROM_MUJOCO
        return Pose(rotation, data.site_xpos[self._site].copy())
