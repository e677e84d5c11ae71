"""Joint positions with which the camera takes a pose: found from the robot's homes by a damped
iteration, and else from many places by quadratic programs with the limits of the joints (mink).
"""

import importlib
from collections.abc import Sequence
from dataclasses import dataclass
from math import degrees
from typing import Any, Protocol

import mujoco
import numpy as np
from numpy.typing import NDArray

from sim.camera.renderer import VISION_FROM_MUJOCO
from sim.geometry import angle_of, log_se3
from sim.robot.drives import random_joints
from sim.types import Array, Pose

STEPS = 200
TOLERANCE = 1e-10
DAMPING = 1e-3
"""Steps of the damped iteration, the error at which it ends [m, rad], which leaves starts exact to
rounding, and its damping; chosen by hand."""
RESTARTS = 40
ENOUGH = 8
"""The search begins at so many places at most, and ends with so many solutions."""
SEARCH_STEPS = 60
NEAR = 1e-3
"""Steps of the search, and the error at which the damped iteration takes over."""
LEAST_COST = 1e-4
"""Weight of a step's size, which keeps it small in singular poses."""
HALF_TURN = np.pi - 1e-5
"""Angle beyond which a rotation has no clear axis, and the damped iteration no direction [rad]."""
COMFORT = 0.5
"""Room before a limit beyond which more does not count [rad or m]."""
VIEW = 0.7
"""Tangent of the half angle of the cone before the camera that no link should be in."""


class Kinematics(Protocol):
    """Joints that carry a camera."""

    model: mujoco.MjModel
    ids: NDArray[np.intp]
    """The joints (n,) in the model."""
    qpos: NDArray[np.intp]
    """Their places (n,) in `qpos`."""
    names: tuple[str, ...]
    lower: Array
    """Lower limits (n,); -inf where there is none."""
    upper: Array
    """Upper limits (n,); inf where there is none."""

    def eye(self, data: mujoco.MjData) -> Pose:
        """Return T_world_camera, as of the last kinematics."""
        ...

    def jacobian(self, data: mujoco.MjData) -> Array:
        """Return the camera twist per joint rate (6, n), as of the last kinematics."""
        ...


@dataclass(frozen=True, slots=True)
class Reach:
    """How near the camera came to a pose. True where it is there, inside the limits."""

    there: bool
    distance: float
    """What is left [m]."""
    angle: float
    """What is left [rad]."""
    joint: str
    """The joint that is nearest to a limit, for its range; empty where none has limits."""
    room: float
    """How far it is from the limit, as a part of its range."""

    def __bool__(self) -> bool:
        return self.there

    def __str__(self) -> str:
        left = f"{self.distance:.2f} m and {degrees(self.angle):.0f} deg are left"
        if not self.joint:
            return f"{left}, and no joint has a limit"
        if self.room < 0.01:
            return f"{left}, and joint '{self.joint}' is at its limit"
        return f"{left}, and no joint is at a limit; '{self.joint}' is nearest to one"


def reach(
    robot: Kinematics, data: mujoco.MjData, homes: Sequence[Sequence[float]], T_world_camera: Pose
) -> Reach:
    """Set the joints so that the camera takes a pose, or comes near it; how near.

    Args:
        robot: Its joints and their limits.
        data: What is set.
        homes: Joint positions to begin at, by order; the first that leads there is taken.
        T_world_camera: The pose.
    """
    if any(iterate(robot, data, home, T_world_camera) for home in homes):
        return _reach(robot, data, T_world_camera, there=True)
    return _search(robot, data, homes, T_world_camera)


def iterate(
    robot: Kinematics, data: mujoco.MjData, home: Sequence[float] | Array, T_world_camera: Pose
) -> bool:
    """Run Newton's method, damped, from one place; True where it ends inside the limits."""
    data.qpos[robot.qpos] = home
    for _ in range(STEPS):
        _refresh(robot, data)
        left = robot.eye(data).inverse() @ T_world_camera
        if angle_of(left.rotation) > HALF_TURN:
            return False
        error = log_se3(left)
        if np.linalg.norm(error) < TOLERANCE:
            q = data.qpos[robot.qpos]
            return bool(np.all((q >= robot.lower) & (q <= robot.upper)))
        J = robot.jacobian(data)
        damped = J @ J.T + DAMPING**2 * np.eye(6)
        data.qpos[robot.qpos] += J.T @ np.linalg.solve(damped, error)
    return False


def _search(
    robot: Kinematics, data: mujoco.MjData, homes: Sequence[Sequence[float]], T_world_camera: Pose
) -> Reach:
    """Take the most comfortable of several solutions, or the posture that came nearest."""
    rng = np.random.default_rng(0)
    starts = [*homes, *random_joints(robot.model, robot.ids, rng, RESTARTS)]
    found: list[tuple[float, Array]] = []
    nearest: tuple[float, Array] = np.inf, np.array(starts[0])
    for start in starts:
        left = _descend(robot, data, start, T_world_camera)
        q = data.qpos[robot.qpos].copy()
        if left < nearest[0]:
            nearest = left, q
        if left < NEAR and iterate(robot, data, q, T_world_camera):
            found.append((comfort(robot, data), data.qpos[robot.qpos].copy()))
        if len(found) == ENOUGH:
            break
    _, data.qpos[robot.qpos] = max(found, key=lambda f: f[0]) if found else nearest
    _refresh(robot, data)
    return _reach(robot, data, T_world_camera, there=bool(found))


def _descend(
    robot: Kinematics, data: mujoco.MjData, start: Sequence[float], T_world_camera: Pose
) -> float:
    """Walk from a place towards the pose inside the limits; the error that is left."""
    mink: Any = importlib.import_module("mink")  # only now: it takes a second
    whole = np.zeros(robot.model.nq)
    whole[robot.qpos] = start
    configuration = mink.Configuration(robot.model, whole)
    task = mink.FrameTask("robot/eye", "site", 1.0, 1.0, lm_damping=1e-3)
    turned = T_world_camera.rotation @ VISION_FROM_MUJOCO.T
    task.set_target(
        mink.SE3.from_rotation_and_translation(
            mink.SO3.from_matrix(turned), T_world_camera.translation
        )
    )
    limits = [mink.ConfigurationLimit(robot.model)]
    left = np.inf
    for _ in range(SEARCH_STEPS):
        before = left
        left = float(np.linalg.norm(task.compute_error(configuration)))
        if left < NEAR / 10 or left > before * 0.999:
            break
        try:
            step = mink.solve_ik(
                configuration, [task], 1.0, "daqp", damping=LEAST_COST, limits=limits
            )
        except mink.NoSolutionFound:
            break
        configuration.integrate_inplace(step, 1.0)
    data.qpos[robot.qpos] = configuration.q[robot.qpos]
    return left


def comfort(robot: Kinematics, data: mujoco.MjData) -> float:
    """Rate a posture: higher where it is far from limits and singular poses, with no link before
    the camera or below the table.
    """
    q = data.qpos[robot.qpos]
    room = np.minimum(q - robot.lower, robot.upper - q).min()
    weakest = np.linalg.svd(robot.jacobian(data), compute_uv=False)[-1]
    links = data.xpos[robot.model.jnt_bodyid[robot.ids]]
    x, y, z = robot.eye(data).inverse().apply(links).T
    seen = (z > 0) & (np.hypot(x, y) < VIEW * z)
    hidden = seen.any() or (links[:, 2] < 0).any()
    return float(min(room, COMFORT) * weakest) * (0.01 if hidden else 1.0)


def _reach(robot: Kinematics, data: mujoco.MjData, T_world_camera: Pose, *, there: bool) -> Reach:
    error = robot.eye(data).inverse() @ T_world_camera
    angle = angle_of(error.rotation)
    q = data.qpos[robot.qpos]
    span = robot.upper - robot.lower
    limited = np.isfinite(span)
    room = np.full(len(q), np.inf)
    np.divide(np.minimum(q - robot.lower, robot.upper - q), span, out=room, where=limited)
    tightest = int(room.argmin())
    name = robot.names[tightest] if limited.any() else ""
    distance = float(np.linalg.norm(error.translation))
    return Reach(there, distance, angle, name, float(room[tightest]))


def _refresh(robot: Kinematics, data: mujoco.MjData) -> None:
    mujoco.mj_kinematics(robot.model, data)
    mujoco.mj_comPos(robot.model, data)
