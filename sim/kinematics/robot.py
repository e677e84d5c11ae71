"""A robot that carries the camera or the target: its design (model and settings), and its
kinematics, such as the joint rates for a camera twist, for any chain of velocity-driven joints.

Joints, limits and actuators are read from the robot's MuJoCo model. There every actuator is a
`velocity` servo of one joint, and the site `eye` is the robot's hand: the optical centre of a
camera that it carries. A model with other actuators is refused, because its robot would not move
as commanded.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from math import inf, sqrt
from typing import Annotated

import daqp
import mujoco
import numpy as np
from annotated_types import Ge, Le

from sim.geometry import VISION_FROM_MUJOCO, angle_of, exp_se3, inverse_if_strong, log_se3
from sim.kinematics.chain import ALL_WAYS
from sim.kinematics.drives import wrong_drive
from sim.mounting import CAMERA, CameraInHand, Mounting
from sim.ranges import EachAcceleration, EachJoint, EachPlay
from sim.types import Array, Pose, Posture

STOP_GAIN = 8.0
"""Largest rate towards a joint limit, per unit of room left [1/s]."""
STOP_MARGIN = 0.01
"""Room that is kept before a joint limit [m or rad]."""
SLACK = 1.0 + 1e-9
"""Factor on a braking distance, against rounding errors."""
AT_END = 1e-3
"""A joint that is nearer to an end of its range than this stands there [m or rad]."""
NEAR_LIMIT = 0.1
"""Share of the way from middle to limit that is near it: there the freedom of an arm of more than
six joints moves the joint back; over as much before it, gradually. Chosen by hand."""
STEPS = 200
"""Most steps of Newton's method."""
TOLERANCE = 1e-10
"""Error at which Newton's method ends [m, rad]: starts are then exact to rounding."""
DAMPING = 1e-3
"""Damping of Newton's method; chosen by hand."""
WHOLE = 1e-6
"""Weight of the twist's length against the square of its error: its direction then errs by about as
much [m/s, rad/s], whatever its length."""
SECOND_TASK = 1e-8
"""Weight of the secondary objective (preferred joint rates): the twist then errs by less than
`EXACT`, and is as long as the limits allow, wherever the arm is not near a singular pose."""
EXACT = 1e-4
"""Difference below which a twist counts as the commanded one [m/s, rad/s]."""
STAYS = 1e3
"""Weight of the parts of a twist that are to stay zero, over that of the others."""
UNLIMITED = 1e6
"""A rate that no joint has: DAQP takes no infinities."""
HALF_TURN = np.pi - 1e-5
"""Angle beyond which a rotation has no clear axis, and Newton's method no direction [rad]."""


@dataclass(frozen=True, slots=True)
class Drives:
    """Settings of the errors of a robot's drives and encoders: encoder noise, encoder step and
    backlash [m or rad], time constant of a lag [ms], and largest acceleration [m/s^2 or rad/s^2]
    (None: unlimited). All but the lag are one value for all joints, or one per joint.
    """

    encoder_noise: EachPlay = 0.0
    """Standard deviation of each reading of a joint, one for all or one each [m or rad]."""
    encoder_step: EachPlay = 0.0
    """Joint positions are read in whole multiples of this step, one for all or one each [m or rad].
    """
    backlash: EachPlay = 0.0
    """Play between motor and joint, one for all or one each [m or rad]: a motor that reverses turns
    so far, and its encoder with it, until the joint follows."""
    lag_ms: Annotated[float, Ge(0), Le(1000)] = 0.0
    """Time constant with which a drive takes over a new rate, before its own servo [ms]."""
    acceleration: EachAcceleration | None = None
    """Largest change per second of the rate that a drive is given, one for all or one each [m/s^2
    or rad/s^2]; by default unlimited.
    """


@dataclass(frozen=True, slots=True)
class Inversion:
    """Settings of the inverse kinematics from camera twist to joint rates.

    The inverse is damped (factor `damping`) where the smallest singular value of the Jacobian
    (camera twist per joint rate) is below `weakest`. Robots of more than six joints use their
    freedom to move towards mid-range (gain `centring` [1/s]) and away from singular poses (gain
    `manipulability` [rad^2/s or m^2/s]). With `exact` the rates bring the camera exactly to where
    the twist leads within the time for which they hold.
    """

    weakest: float = 0.02
    """Below this smallest singular value of the Jacobian [m/s or rad/s of the camera per unit of
    joint rate] the inverse is damped."""
    damping: float = 0.02
    """Damping factor lambda in a singular pose; the camera then moves slower than commanded, and in
    another direction."""
    centring: float = 1.0
    """With more than six joints: how fast those with limits move towards the middle between them
    [1/s], as far as this does not move the camera (Liegeois 1977)."""
    manipulability: float = 1.0
    """With more than six joints: how fast they move along the gradient of the logarithm of the
    manipulability [rad^2/s or m^2/s], as far as this does not move the camera. More costs room to
    the limits, down to `NEAR_LIMIT`."""
    exact: bool = False
    """Take the rates that bring the camera exactly to where the twist leads by the next update of
    the drives; otherwise those that the twist needs at the beginning are held until then."""


@dataclass(frozen=True, slots=True)
class Design:
    """A robot before it is put into the room, as a robot's `Config.build` returns it: its model and
    drives, the joint positions from which inverse kinematics searches (`homes`), the pose of its
    base in the room, and whether it carries the camera or the target (`mounting`).

    Its model needs a camera and a site, both called `eye`, at the same pose, and one `velocity`
    actuator for each joint of the chain that carries them. `Robot` reads all limits from the model.

    >>> from sim.robots import gantry
    >>> design = gantry.Config(lag_ms=20.0).build(np.random.default_rng(0))
    >>> design.name, len(design.spec.actuators), design.drives.lag_ms
    ('gantry.xml', 6, 20.0)
    """

    name: str
    """Name of its model in messages, such as "gantry.xml"."""
    spec: mujoco.MjSpec
    """Its model, with a camera and a site `eye`, and one velocity actuator for each joint."""
    drives: Drives
    """Errors of its drives and encoders."""
    homes: tuple[tuple[float, ...], ...]
    """Joint positions (n,) [m or rad] at which a search for other joint positions begins, one after
    another; if there are none, it begins at random positions."""
    base: Pose = field(default_factory=lambda: Pose.planar(0.0, 0.0, 0.0))
    """T_room_base: where it stands; the room's z is up, and the table's top at z = 0."""
    inversion: Inversion = Inversion()
    """Settings of the inverse kinematics."""
    mounting: Mounting = field(default_factory=CameraInHand)
    """Mounting: the robot carries the camera, or the target."""
    advice: str = ""
    """End of the message that a start pose is out of reach: settings that the user can change."""


def own_name(name: str) -> str:
    """Return the name of a joint or actuator in the robot's own model, given its name in the
    scene's model, which begins with "robot/".
    """
    return name.removeprefix("robot/")


def damped_inverse(J: Array, inversion: Inversion) -> Array:
    """Return the (pseudo-)inverse (n, 6) of a Jacobian (6, n), damped where its smallest singular
    value is below `inversion.weakest`: joint rates stay finite there, and make the twist only
    approximately.

    After Nakamura and Hanafusa 1986: with s the smallest singular value and e = `weakest`, lambda^2
    = damping^2 (1 - (s / e)^2) where s < e, else zero; s_i becomes s_i / (s_i^2 + lambda^2).
    """
    if (
        J.shape[0] == J.shape[1]
        and (inverse := inverse_if_strong(J, inversion.weakest)) is not None
    ):
        return inverse
    U, s, Vt = np.linalg.svd(J, full_matrices=False)
    missing = max(0.0, 1.0 - (s[-1] / inversion.weakest) ** 2)
    return (Vt.T * (s / (s**2 + missing * inversion.damping**2))) @ U.T


def each_joint(setting: str, given: EachJoint, names: tuple[str, ...]) -> Array:
    """Return the values (n,) of a setting for n joints, given one value for all joints or one for
    each.

    Args:
        setting: Name of the setting, for the message.
        given: One number, or a tuple of n numbers.
        names: Names of the n joints.

    Raises:
        ValueError: The number of values is neither 1 nor n.
    """
    values = np.ravel(given).astype(np.float64)
    if len(values) not in (1, len(names)):
        raise ValueError(
            f"{setting} has {len(values)} values; it should have one for all joints, or "
            f"{len(names)} for {', '.join(names)}"
        )
    return np.broadcast_to(values, len(names)).copy()


def _check_drives(model: mujoco.MjModel, design: Design) -> None:
    """Check that all actuators are velocity servos, and that the robot can carry its camera.

    Raises:
        ValueError: The model has no actuator or a wrong one, or its site `eye` is not where its
            camera is.
    """
    place = f"the robot's model {design.name}"
    if model.nu == 0:
        raise ValueError(f"{place} has no actuators: add a velocity actuator for each joint")
    for i in range(model.nu):
        if (wrong := wrong_drive(model, i)) is not None:
            name = own_name(model.actuator(i).name)
            raise ValueError(
                f"{place}: the actuator '{name}' cannot be used as a velocity drive, because it "
                f"{wrong}"
            )
    design.mounting.check(model, place)


class Robot:
    """The n driven joints of a robot, read from a scene's MuJoCo model, and the kinematics of the
    chain from its base to its hand, the site `eye`.

    The robot carries the camera or holds the target. Camera poses are T_world_camera, or
    T_target_camera if it holds the target. Camera twists are relative to the same frame (world or
    target), and given in the camera frame. Its methods read joint positions from MuJoCo's state
    `data`.
    """

    def __init__(self, model: mujoco.MjModel, design: Design) -> None:
        """Read the joints and their drives from a model.

        Raises:
            ValueError: The model cannot be used as a robot, or `robot.acceleration` has a wrong
                number of values; the message says what is wrong.
        """
        _check_drives(model, design)
        self.model = model
        self.homes = design.homes
        self._inversion = design.inversion
        self.mounting = design.mounting
        self.advice = design.advice
        self._site = model.site(CAMERA).id
        self.drives = np.argsort(model.actuator_trnid[:, 0])
        """The actuator of each joint (n,); joints are in the order of the chain, from the base."""
        self.ids = joints = model.actuator_trnid[self.drives, 0]
        self.names = tuple(own_name(model.joint(j).name) for j in joints)
        slides = model.jnt_type[joints] == mujoco.mjtJoint.mjJNT_SLIDE
        self.units = tuple("m" if slide else "rad" for slide in slides)
        self.qpos = model.jnt_qposadr[joints]
        self._dof = model.jnt_dofadr[joints]
        limited = model.jnt_limited[joints].astype(bool)
        self.lower = np.where(limited, model.jnt_range[joints, 0], -np.inf)
        self.upper = np.where(limited, model.jnt_range[joints, 1], np.inf)
        bounded = model.actuator_ctrllimited[self.drives].astype(bool)[:, None]
        rates = np.where(bounded, model.actuator_ctrlrange[self.drives], [-np.inf, np.inf])
        self.slowest, self.fastest = rates.T
        self._stops = (self.lower + STOP_MARGIN).tolist(), (self.upper - STOP_MARGIN).tolist()
        self._speeds = list(zip(self.slowest.tolist(), self.fastest.tolist(), strict=True))
        self._limited = limited
        self._freedom = len(joints) > ALL_WAYS and not design.inversion.exact
        self._middles = np.where(limited, model.jnt_range[joints].mean(axis=1), 0.0)
        self._halves = np.where(limited, np.ptp(model.jnt_range[joints], axis=1) / 2, np.inf)
        most = design.drives.acceleration
        self._accelerates = most is not None
        self._most = each_joint("robot.acceleration", inf if most is None else most, self.names)
        braking = [
            (_braking(-slow, a), _braking(fast, a))
            for (slow, fast), a in zip(self._speeds, self._most.tolist(), strict=True)
        ]
        first, last = (model.jnt_range[joints] + (STOP_MARGIN, -STOP_MARGIN)).T
        to_lower, to_upper = np.transpose(braking)
        free = (
            np.where(limited, first + to_lower, -np.inf),
            np.where(limited, last - to_upper, np.inf),
        )
        self._free = list(zip(*np.array(free).tolist(), strict=True))
        """Positions of each joint between which its range does not limit its rate."""
        self._carries = (joints[:, None] <= joints).astype(np.float64)
        """Matrix (n, n): 1 where the joint of the row moves that of the column, or is the same
        joint, else 0. The joints of a chain are numbered from its base on."""
        self._jacobians = np.zeros((2, 3, model.nv))
        self._ahead = mujoco.MjData(model)

    @property
    def has_ranges(self) -> bool:
        """True if the position of at least one joint has limits."""
        return bool(self._limited.any())

    def servos(self) -> Array:
        """Return the time constants (n,) [s] with which the velocity servos of the n joints take
        over a new rate, in a simulation with implicit integration.
        """
        model = self.model
        at = model.jnt_dofadr[self.ids]
        strength = model.actuator_gainprm[self.drives, 0] + model.dof_damping[at]
        step = model.opt.timestep
        return step / np.log1p(step * strength / model.dof_M0[at])

    def posture(self, data: mujoco.MjData, twist: Array, accepted: Array | None = None) -> Posture:
        """Return the robot's posture by the poses that MuJoCo computed last in `data`: the camera's
        pose T_world_camera (T_target_camera if the robot holds the target), joint positions, limits
        of joints and of their rates, the Jacobian (6, n) from joint rates to the camera's twist,
        and the given twists. Twists are in the camera frame, relative to the world, or to the
        target if the robot holds it.

        Args:
            data: MuJoCo's state, with the joint positions.
            twist: Mean camera twist (6,) since the last frame [m/s, rad/s].
            accepted: Mean since the last frame of the camera twists (6,) that the drives were set
                to [m/s, rad/s]; None: unknown.
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

    def place(self, data: mujoco.MjData, q: Sequence[float] | Array) -> Pose:
        """Set the joint positions (n,) [m or rad] in `data`, and compute the poses of all bodies;
        return the camera's pose T_world_camera, or T_target_camera if the robot holds the target.
        """
        data.qpos[self.qpos] = q
        self.refresh(data)
        return self.eye(data)

    def joints(self, data: mujoco.MjData) -> Array:
        """Return a copy of the robot's joint positions (n,) in `data` [m or rad]."""
        return data.qpos[self.qpos].copy()

    def room(self, data: mujoco.MjData) -> Array:
        """Return the distance of each joint in `data` from its nearer limit, divided by the width
        of its range (n,): 0.5 in mid-range, 0 at a limit, negative beyond it, and inf for a joint
        without limits.
        """
        q = data.qpos[self.qpos]
        nearer = np.minimum(q - self.lower, self.upper - q)
        room = np.full(len(q), np.inf)
        return np.divide(nearer, self.upper - self.lower, out=room, where=self._limited)

    def rates_measured(self, data: mujoco.MjData) -> Array:
        """Return a copy of the robot's joint velocities (n,) in `data` [m/s or rad/s]."""
        return data.qvel[self._dof].copy()

    def jacobian(self, data: mujoco.MjData) -> Array:
        """Return the Jacobian (6, n) from joint rates to the camera's twist for the poses that
        MuJoCo computed last in `data`. The twist is in the camera frame (x right, y down, z
        forward), relative to the world, or to the target if the robot holds it.
        """
        linear, angular = self._jacobians
        mujoco.mj_jacSite(self.model, data, linear, angular, self._site)
        # mj_jacSite gives twists of the site's origin along world axes: only a rotation is left.
        R_camera_world = (data.site_xmat[self._site].reshape(3, 3) @ VISION_FROM_MUJOCO).T
        J = (R_camera_world @ self._jacobians).reshape(6, -1)[:, self._dof]
        return self.mounting.jacobian(J, partial(self.hand, data))

    def rates(
        self, data: mujoco.MjData, twist: Array, hold: float = 0.0, before: Array | None = None
    ) -> tuple[Array, Array, tuple[str, ...]]:
        """Return the joint rates (n,) [m/s or rad/s] for a commanded camera twist, the camera twist
        (6,) that these rates make, and the joints whose limits changed the commanded twist, each
        with the limit's kind: "elbow (range)", "elbow (speed)" or "elbow (acceleration)".

        A joint at the end of its range leaves the solution: it is as fast as its range allows, and
        the other joints make the rest of the twist. If rates are too fast, the twist gets shorter
        and keeps its direction, as far as the limits of acceleration allow. A quadratic programme
        chooses the rates where joints have such limits, or a robot without exact inversion has more
        than six joints; otherwise one factor slows all joints.

        Args:
            data: MuJoCo's state, with the joint positions.
            twist: The commanded twist (6,) in the camera frame [m/s, rad/s].
            hold: Time for which the rates hold [s], for exact inversion and acceleration limits.
            before: The rates (n,) before these [m/s or rad/s]; None: accelerations are not limited.
        """
        J = self.jacobian(data)
        exact = self._exact(data, twist, hold) if self._inversion.exact and hold else None
        inverse = damped_inverse(J, self._inversion)
        wanted = inverse @ twist if exact is None else exact
        # A redundant arm adds motion in the null space of J, which leaves the camera where it is.
        liked = wanted + self._spare(data, J, inverse) if self._freedom else wanted
        box = self._box(data, hold, before)
        # What is not a number passes: the loop then names the part that it came from.
        if _are_inside(liked, box):
            return liked, J @ liked, ()
        if self._freedom or self._accelerates:
            rates = _programme(J, wanted, liked, box)
            made = J @ rates
            # The other joints made up for the limited ones: no limit is reported.
            if np.abs(made - J @ wanted).max() < EXACT:
                return rates, made, ()
            names = self._outside(data, wanted, box) or self._outside(data, liked, box)
            # Fix joints at the end of their range first, then solve again with the twist of the
            # others as the one to keep the direction of.
            left = self._inside_ranges(data, J, twist, wanted)
            if left is not wanted:
                rates = _programme(J, left, left + liked - wanted, box)
                made = J @ rates
            return rates, made, names
        # Six joints or fewer leave no choice: one factor on all rates keeps the direction.
        left = self._inside_ranges(data, J, twist, wanted)
        slowed = left * _slowed(left, box)
        return slowed, J @ slowed, self._outside(data, wanted, box)

    def _inside_ranges(self, data: mujoco.MjData, J: Array, twist: Array, wanted: Array) -> Array:
        """Return rates (n,) with which no joint leaves its range: a joint that would leave it is as
        fast as its range allows, and the others come as near to the rest of the twist as they can.
        Components of the twist that are zero have priority: a level camera stays level.
        """
        weights = np.where(twist == 0.0, STAYS, 1.0)
        low, high = np.transpose(self._ends(data))
        rates = wanted
        free = np.ones(len(wanted), bool)
        # Each round fixes at least one joint, so that it ends after n rounds at most.
        while (over := free & ((rates < low) | (rates > high))).any():
            rates = np.where(over, rates.clip(low, high), rates)
            free &= ~over
            if free.any():
                rest = twist - J[:, ~free] @ rates[~free]
                weighted = weights[:, None] * J[:, free]
                rates[free] = damped_inverse(weighted, self._inversion) @ (weights * rest)
        return rates

    def _ends(self, data: mujoco.MjData) -> list[tuple[float, float]]:
        """Return the least and the largest rate of each joint that its range allows."""
        # A few joints: Python is faster here than arrays.
        q = data.qpos[self.qpos].tolist()
        joints = zip(q, self._stops[0], self._stops[1], self._most.tolist(), strict=True)
        return [(-_stopping(at - low, a), _stopping(high - at, a)) for at, low, high, a in joints]

    def stopped(self, data: mujoco.MjData, rates: Array) -> list[str]:
        """Return the joints in `data` that stand at an end of their range (within 0.001 m or rad)
        and that the given rates (n,) [m/s or rad/s] drive further out, such as "elbow (range)".
        """
        q = data.qpos[self.qpos]
        back = (q < self.lower + AT_END) & (rates < 0)
        on = (q > self.upper - AT_END) & (rates > 0)
        return [f"{self.names[k]} (range)" for k in np.flatnonzero(back | on)]

    def driven(self, rates: Array, hold: float) -> Array:
        """Return the joint rates (n,) [m/s or rad/s] that result if the motors have the given rates
        for a time `hold` [s]: the same rates, because this robot has no backlash.
        """
        return rates

    def _exact(self, data: mujoco.MjData, twist: Array, hold: float) -> Array | None:
        """Return the rates (n,) that bring the camera exactly to the end of a twist held for a time
        [s]; None where no joint positions inside the limits lead there.
        """
        q = self.joints(data)
        ahead = self._ahead
        ahead.qpos[:] = data.qpos
        mujoco.mj_kinematics(self.model, ahead)
        there = self.converge(ahead, q, self.eye(ahead) @ exp_se3(twist * hold))
        return (self.joints(ahead) - q) / hold if there else None

    def _box(
        self, data: mujoco.MjData, hold: float, before: Array | None
    ) -> list[tuple[float, float]]:
        """Return the least and the largest rate of each joint [m/s or rad/s], by its range, its
        speed and, after the rates `before`, its acceleration.
        """
        box = self._speeds
        if not _are_inside(data.qpos[self.qpos], self._free):
            joints = zip(self._ends(data), self._speeds, strict=True)
            box = [(max(slow, low), min(fast, high)) for (low, high), (slow, fast) in joints]
        if before is None or not self._accelerates:
            return box
        change = self._most * hold
        # A joint that cannot brake in time for its limit keeps its acceleration.
        low, high = np.clip(np.transpose(box), before - change, before + change).tolist()
        return list(zip(low, high, strict=True))

    def _outside(
        self, data: mujoco.MjData, rates: Array, box: list[tuple[float, float]]
    ) -> tuple[str, ...]:
        """Return the joints whose rates (n,) are outside a box, each with the cause: its range, its
        speed or its acceleration.
        """
        found = list[str]()
        joints = zip(self.names, rates.tolist(), box, strict=True)
        free = self._box(data, 0.0, None)
        for k, (name, rate, (low, high)) in enumerate(joints):
            if low <= rate <= high:
                continue
            most, own, fastest = (
                (high, free[k][1], self.fastest[k])
                if rate > high
                else (-low, -free[k][0], -self.slowest[k])
            )
            cause = "acceleration" if most != own else "range" if own < fastest else "speed"
            found.append(f"{name} ({cause})")
        return tuple(found)

    def _spare(self, data: mujoco.MjData, J: Array, inverse: Array) -> Array:
        """Return rates (n,) towards the middles between the limits, and away from singular poses,
        that do not move the camera.

        After Liegeois 1977 (Automatic supervisory control of the configuration and behavior of
        multibody mechanisms, IEEE Trans. SMC 7): the gradients of the squared distances from the
        middles and of the manipulability, projected into the null space of the Jacobian. Near a
        limit only the joints that are near theirs count: projected, the gradient for all joints can
        push such a joint on towards its limit, but the gradient for this joint alone cannot.
        """
        away = np.where(self._limited, data.qpos[self.qpos] - self._middles, 0.0)
        inside = ((1.0 - NEAR_LIMIT - np.abs(away) / self._halves) / NEAR_LIMIT).clip(0.0, 1.0)
        free = -self._inversion.centring * away
        if self._inversion.manipulability:
            free += self._inversion.manipulability * self.manipulability_gradient(J, inverse)
        free = inside.min() * free - self._inversion.centring * (1.0 - inside) * away
        return free - np.linalg.pinv(J) @ (J @ free)

    def manipulability_gradient(self, J: Array, inverse: Array) -> Array:
        """Return the gradient (n,) of log sqrt(det(J J^T)) (Yoshikawa 1985) with respect to the n
        joint positions [1/rad or 1/m]; it is finite in singular poses.

        It is the trace of J+ dJ/dq_i. With v_j and w_j the columns of J (Haviland and Corke 2023,
        Manipulator Differential Kinematics, part 2, in the axes of the camera): dv_j/dq_i = w_i x
        v_j and dw_j/dq_i = w_i x w_j where i moves j, else w_j x v_i and zero.

        Args:
            J: The Jacobian (6, n), as `jacobian` returns it.
            inverse: Damped inverse (n, 6) of the Jacobian.
        """
        # Of the hand: a target that it holds moves against the camera.
        v, w = np.hsplit(self.mounting.sign * J.T, 2)
        v_row, w_row = np.hsplit(self.mounting.sign * inverse, 2)
        moved = self._carries @ (_cross(v, v_row) + _cross(w, w_row))
        others = (1.0 - self._carries) @ _cross(v_row, w)
        return np.sum(w * moved + v * others, axis=1)

    def converge(
        self, data: mujoco.MjData, begin: Sequence[float] | Array, T_world_camera: Pose
    ) -> bool:
        """Find joint positions for a camera pose by damped Newton steps, and set them in `data`.
        Return True if the steps converge and the positions are inside the joint limits.

        Args:
            data: MuJoCo's state; its joint positions are set, even on failure.
            begin: Joint positions to begin from (n,) [m or rad].
            T_world_camera: The desired camera pose; T_target_camera if the robot holds the target.
        """
        data.qpos[self.qpos] = begin
        for _ in range(STEPS):
            self.refresh(data)
            left = self.eye(data).inverse() @ T_world_camera
            if angle_of(left.rotation) > HALF_TURN:
                return False
            # The twist that removes the error in unit time, in the camera's frame as J has it.
            error = log_se3(left)
            if np.linalg.norm(error) < TOLERANCE:
                q = data.qpos[self.qpos]
                return bool(np.all((q >= self.lower) & (q <= self.upper)))
            J = self.jacobian(data)
            damped = J @ J.T + DAMPING**2 * np.eye(6)
            data.qpos[self.qpos] += J.T @ np.linalg.solve(damped, error)
        return False

    def refresh(self, data: mujoco.MjData) -> None:
        """Compute the poses of all bodies in `data` from its joint positions, and what MuJoCo needs
        for Jacobians.
        """
        mujoco.mj_kinematics(self.model, data)
        mujoco.mj_comPos(self.model, data)

    def eye(self, data: mujoco.MjData) -> Pose:
        """Return the camera's pose by the poses that MuJoCo computed last in `data`:
        T_world_camera, or T_target_camera if the robot holds the target.
        """
        return self.mounting.eye(self.hand(data))

    def camera(self, data: mujoco.MjData) -> Pose:
        """Return the camera's pose T_world_camera by the poses that MuJoCo computed last in `data`,
        also if the robot holds the target.
        """
        standing = self.mounting.standing
        return self.hand(data) if standing is None else standing

    def hand(self, data: mujoco.MjData) -> Pose:
        """Return T_world_hand, the pose of the site `eye` in the robot's hand (x right, y down, z
        forward), by the poses that MuJoCo computed last in `data`.
        """
        rotation = data.site_xmat[self._site].reshape(3, 3) @ VISION_FROM_MUJOCO
        return Pose(rotation, data.site_xpos[self._site].copy())


def _are_inside(values: Array, bounds: list[tuple[float, float]]) -> bool:
    """Return whether all values (n,) are inside their bounds; nan counts as inside."""
    for value, (low, high) in zip(values.tolist(), bounds, strict=True):
        if value < low or value > high:
            return False
    return True


def _cross(a: Array, b: Array) -> Array:
    """Return the cross products (n, 3) of rows; `np.cross` takes ten times as long."""
    return a[:, [1, 2, 0]] * b[:, [2, 0, 1]] - a[:, [2, 0, 1]] * b[:, [1, 2, 0]]


def _stopping(room: float, acceleration: float) -> float:
    """Return the largest rate [m/s or rad/s] of a joint towards its limit.

    Near the limit the rate falls exponentially, and before that by half the acceleration: the other
    half covers the lag of the drive.

    Args:
        room: Distance to the limit [m or rad].
        acceleration: Largest acceleration of the joint [m/s^2 or rad/s^2].
    """
    room = max(room, 0.0)
    if room <= acceleration / (2 * STOP_GAIN**2):
        return STOP_GAIN * room
    # v(room) of constant braking; it meets the exponential with the same value and slope.
    return sqrt(acceleration * (room - acceleration / (4 * STOP_GAIN**2)))


def _braking(rate: float, acceleration: float) -> float:
    """Return the distance [m or rad] from its limit from which on a joint may have a rate [m/s or
    rad/s] towards it: the inverse of `_stopping`.
    """
    if rate <= acceleration / (2 * STOP_GAIN):
        return SLACK * rate / STOP_GAIN
    return SLACK * (rate**2 / acceleration + acceleration / (4 * STOP_GAIN**2))


def _slowed(wanted: Array, box: list[tuple[float, float]]) -> float:
    """Return the largest factor, at most 1, that brings all wanted rates (n,) between the least and
    the largest rate of each joint.
    """
    pairs = zip(wanted.tolist(), box, strict=True)
    factors = ((high if rate > 0 else low) / rate for rate, (low, high) in pairs if rate)
    return min((1.0, *factors))


def _programme(J: Array, wanted: Array, liked: Array, box: list[tuple[float, float]]) -> Array:
    """Return the joint rates q' (n,), inside a box, that make the camera twist nearest to k v, with
    0 <= k <= 1 as large as possible; of several such rates, the ones nearest to preferred rates.

    v is the twist that the wanted rates make. The quadratic programme in q' and k |v| is solved by
    DAQP (Arnstrom, Bemporad and Axehill, A dual active-set solver for embedded quadratic
    programming using recursive LDL^T updates, IEEE TAC 2022).

    Args:
        J: The Jacobian (6, n).
        wanted: The rates (n,) that make the twist.
        liked: The preferred rates (n,): those of the twist, and motion in the null space.
        box: The least and the largest rate of each joint; zero need not lie between them.
    """
    twist = J @ wanted
    length = float(np.linalg.norm(twist))
    # Of |J q' - k v|^2 / 2 + SECOND_TASK |q' - liked|^2 / 2 - WHOLE k |v| the last term makes the
    # twist as long as possible.
    A = np.column_stack([J, twist / -(length or 1.0)])
    H = A.T @ A + SECOND_TASK * np.eye(len(liked) + 1)
    f = -SECOND_TASK * np.append(liked, length)
    f[-1] -= WHOLE
    lower, upper = np.clip([*box, (0.0, length)], -UNLIMITED, UNLIMITED).T.copy()
    none = np.zeros((0, len(f)))
    found, _, _, _ = daqp.solve(H, f, none, upper, lower, np.zeros(len(f), np.intc))
    # The solver keeps a bound to 1e-6 only.
    return found.clip(lower, upper)[:-1]
