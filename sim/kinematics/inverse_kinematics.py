"""Inverse kinematics: joint positions with which the camera takes a pose.

The search begins at the robot's home positions, with damped Newton steps. If these find no
solution, quadratic programs that keep the limits of the joints (mink) begin there and at many
random positions; if they fail too, least squares in a trust region begin at the same positions.
"""

import importlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from math import degrees
from typing import Any

import mujoco
import numpy as np

from sim.geometry import VISION_FROM_MUJOCO, angle_of, inverse, left_jacobian, skew
from sim.kinematics.chain import ALL_WAYS
from sim.kinematics.drives import random_joints
from sim.kinematics.robot import Robot
from sim.kinematics.rollout import Rollout, roll_out
from sim.types import Array, Pose

RESTARTS = 40
"""Largest number of random starts of the search."""
ENOUGH = 8
"""Number of solutions with which the search ends."""
MOST_WAYS = 40
"""Largest number of postures from which a path is predicted."""
OUT_OF_REACH = 0.5
"""If all quadratic programs end farther from a pose [m and rad], it is hardly in reach: least
squares begin at the first `FAR_STARTS` positions only."""
FAR_STARTS = 8
"""Number of these positions: the first one found five poses that quadratic programs missed."""
SEARCH_STEPS = 60
"""Most steps from one start."""
NEAR = 1e-3
"""Error below which the damped iteration takes over [m and rad]."""
LEAST_COST = 1e-4
"""Weight of a step's size, which keeps it small in singular poses."""
COMFORT = 1.0
"""Distance from a limit beyond which more does not count [rad or m]."""
LOOKS = 12
"""Number of random starts for a robot of few joints that looks at a point."""
BESIDE = 1e-3
"""Weight of the pose's error, relative to that of the direction in which a point is seen."""
SEEN = 1e-3
"""Largest error of the direction in which a point is seen [rad]: a third of a pixel."""
NEARLY_SEEN = 0.3
"""The same for a robot of one joint [rad]."""
VIEW = 0.7
"""Tangent of the half angle of the cone before the camera that no link should be in."""


@dataclass(frozen=True, slots=True)
class Reach:
    """Result of a search for joint positions that bring the camera to a desired pose: distance [m]
    and angle [rad] that are left to the pose; the name of the joint nearest to a limit, and its
    distance from the limit as a share of its range (`room`; "" and inf if no joint has limits); and
    the prediction of the joints along the camera path that follows.

    The prediction is None if no path was given, the pose is not reached, the robot has fewer than
    six joints, or none has limits. As a condition the result is true if the camera is at the pose,
    or if a robot of fewer than six joints sees the desired point in the desired direction, with all
    joints inside their limits.
    """

    there: bool
    distance: float
    """Distance that is left to the pose [m]."""
    angle: float
    """Angle that is left to the pose [rad]."""
    joint: str
    """Name of the joint that is nearest to a limit, relative to its range; empty if no joint has
    limits."""
    room: float
    """Distance of this joint from the limit, as a share of its range."""
    rollout: Rollout | None = None
    """Prediction of the joints along the path that follows; None if nothing was predicted."""

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
    robot: Robot,
    data: mujoco.MjData,
    T_world_camera: Pose,
    point: Array | None = None,
    way: Callable[[], Sequence[Pose]] | None = None,
) -> Reach:
    """Find joint positions with which the camera reaches a desired pose or comes near it, and set
    them in `data`; return how near it comes.

    The search begins at the robot's home positions, one after another. Without a solution from
    there, the one with the highest score `comfort` of several solutions is taken. If a joint would
    reach its limit on the path that follows, the solution that keeps the largest distance from all
    limits is taken instead, if there is one. For a robot of fewer than six joints it is enough that
    the camera sees a point in the desired direction, and the path does not count.

    Args:
        robot: The robot, with its joint limits and home positions.
        data: MuJoCo's state; its joint positions are set.
        T_world_camera: The desired pose; T_target_camera if the robot holds the target.
        point: Point (3,) at which the camera looks, in the same frame [m]; None: the point 1 m
            ahead on the desired optical axis.
        way: Function that returns the camera poses that follow, one every 0.2 s (see `roll_out`),
            in the same frame; None: no path follows.
    """
    # Lazily: a later home is tried only when a joint of an earlier solution leaves its range.
    homes = (home for home in robot.homes if robot.converge(data, home, T_world_camera))
    found: Iterator[Array] = (data.qpos[robot.qpos].copy() for _ in homes)
    there = next(found, None) is not None
    if not there and len(robot.ids) < ALL_WAYS:
        axis = T_world_camera.apply(np.array([0.0, 0.0, 1.0]))
        there = _look(robot, data, T_world_camera, axis if point is None else point)
    elif not there:
        found = iter(_search(robot, data, T_world_camera))
        there = next(found, None) is not None
    rollout = None
    if there and way is not None and len(robot.ids) >= ALL_WAYS and robot.has_ranges:
        rollout = _keep_inside(robot, data, found, way())
    error = robot.eye(data).inverse() @ T_world_camera
    room = robot.room(data)
    tightest = int(room.argmin())
    return Reach(
        there,
        distance=float(np.linalg.norm(error.translation)),
        angle=angle_of(error.rotation),
        joint=robot.names[tightest] if robot.has_ranges else "",
        room=float(room[tightest]),
        rollout=rollout,
    )


def _keep_inside(
    robot: Robot, data: mujoco.MjData, others: Iterable[Array], way: Sequence[Pose]
) -> Rollout:
    """Set the joint positions from which the joints stay inside their ranges on a camera path;
    return their prediction.

    The present positions are kept if no joint reaches a limit from there. Else those that keep the
    largest distance from all limits are taken: one of `others`, or one that differs by a whole turn
    of a joint. If from all of them a joint reaches a limit, the present ones are kept.
    """
    begin = data.qpos[robot.qpos].copy()
    first = roll_out(robot, data, way)
    if not first.joint:
        return first
    best = first, begin
    waiting = [*_turned(robot, begin, first.joint), *others]
    for _ in range(MOST_WAYS):
        if not waiting:
            break
        q = waiting.pop(0)
        robot.place(data, q)
        tried = roll_out(robot, data, way)
        if tried.joint:
            waiting += _turned(robot, q, tried.joint)
        elif best[0].joint or tried.room > best[0].room:
            best = tried, q
    rollout, q = best
    robot.place(data, q)
    return rollout


def _turned(robot: Robot, q: Array, joint: str) -> list[Array]:
    """Return the joint positions, each (n,) [m or rad], that differ from `q` (n,) by one turn,
    forwards or backwards, of the hinge called `joint`, and stay inside its range; [] for a slide.
    """
    at = robot.names.index(joint)
    if robot.units[at] != "rad":
        return []
    turn = 2 * np.pi * np.eye(len(q))[at]
    return [p for p in (q - turn, q + turn) if robot.lower[at] <= p[at] <= robot.upper[at]]


def _look(robot: Robot, data: mujoco.MjData, T_world_camera: Pose, point: Array) -> bool:
    """Turn the camera so that it sees a point in the same direction as from a pose, and comes as
    near to this pose as possible; return whether it sees the point there.

    One joint cannot centre a point: then a deviation of `NEARLY_SEEN` is accepted.
    """
    wanted = _direction(T_world_camera, point)

    def error(q: Array) -> Array:
        eye = robot.place(data, q)
        aside = _direction(eye, point) - wanted
        turned = (eye.rotation - T_world_camera.rotation).ravel()
        moved = eye.translation - T_world_camera.translation
        return np.concatenate((aside, BESIDE * moved, BESIDE * turned))

    rng = np.random.default_rng(0)
    starts = [*robot.homes, *random_joints(robot.model, robot.ids, rng, LOOKS)]
    left = _least_squares(robot, error, starts)
    return float(np.linalg.norm(left[:3])) < (SEEN if len(robot.ids) > 1 else NEARLY_SEEN)


def _direction(T_world_camera: Pose, point: Array) -> Array:
    """Return the unit vector (3,) from a camera to a point, in the camera frame."""
    towards = T_world_camera.inverse().apply(point)
    return towards / np.sqrt(towards.dot(towards))  # `norm` does the same, and takes longer


def _search(robot: Robot, data: mujoco.MjData, T_world_camera: Pose) -> list[Array]:
    """Set the joint positions of the most comfortable of several solutions, or, without a solution,
    the nearest ones; return the solutions (n,), the most comfortable first.
    """
    rng = np.random.default_rng(0)
    starts = [*robot.homes, *random_joints(robot.model, robot.ids, rng, RESTARTS)]
    found: list[tuple[float, Array]] = []
    nearest: tuple[float, Array] = np.inf, np.array(starts[0])
    # First all quadratic programs, then, only if none succeeds, all slower least-squares fits.
    for walk, (number, start) in product((_descend, _fit), enumerate(starts)):
        is_far = nearest[0] > OUT_OF_REACH and number >= FAR_STARTS
        if len(found) == ENOUGH or (walk is _fit and (found or is_far)):
            break
        left = walk(robot, data, start, T_world_camera)
        q = data.qpos[robot.qpos].copy()
        if left < nearest[0]:
            nearest = left, q
        if left < NEAR and robot.converge(data, q, T_world_camera):
            found.append((comfort(robot, data), data.qpos[robot.qpos].copy()))
    solutions = [q for _, q in sorted(found, key=lambda f: -f[0])]
    robot.place(data, solutions[0] if solutions else nearest[1])
    return solutions


def _descend(
    robot: Robot, data: mujoco.MjData, start: Sequence[float], T_world_camera: Pose
) -> float:
    """Move the joints from a start towards a pose, inside their limits, by quadratic programs;
    return the norm of the error that is left [m and rad].
    """
    mink = importlib.import_module("mink")  # only now: it takes a second
    whole = np.zeros(robot.model.nq)
    whole[robot.qpos] = start
    configuration = mink.Configuration(robot.model, whole)
    task = mink.FrameTask("robot/eye", "site", 1.0, 1.0, lm_damping=1e-3)
    hand = robot.mounting.hand(T_world_camera)
    turned = hand.rotation @ VISION_FROM_MUJOCO.T
    task.set_target(
        mink.SE3.from_rotation_and_translation(mink.SO3.from_matrix(turned), hand.translation)
    )
    limits = [mink.ConfigurationLimit(robot.model)]
    left = np.inf
    for _ in range(SEARCH_STEPS):
        before = left
        left = float(np.linalg.norm(task.compute_error(configuration)))
        # It has arrived, or is stuck at a limit.
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


def _fit(robot: Robot, data: mujoco.MjData, start: Sequence[float], T_world_camera: Pose) -> float:
    """Move the joints from a start towards a pose, inside their limits, by bounded least squares;
    return the norm of the error that is left [m and rad]. This is slower than `_descend`, but
    seldom gets stuck at a limit.
    """
    from scipy.spatial.transform import Rotation  # only now: it takes a second

    def error(q: Array) -> Array:
        left = robot.place(data, q).inverse() @ T_world_camera
        return np.append(left.translation, Rotation.from_matrix(left.rotation).as_rotvec())

    def slopes(q: Array) -> Array:
        """Return the derivative (6, n) of the error by the joint positions."""
        moved, turned = np.split(error(q), 2)
        J = robot.jacobian(data)
        return np.vstack([skew(moved) @ J[3:] - J[:3], -inverse(left_jacobian(turned)) @ J[3:]])

    return float(np.linalg.norm(_least_squares(robot, error, [start], slopes, SEARCH_STEPS)))


def _least_squares(
    robot: Robot,
    error: Callable[[Array], Array],
    starts: Iterable[Sequence[float] | Array],
    slopes: Callable[[Array], Array] | None = None,
    steps: int | None = None,
) -> Array:
    """Return the error (m,) of the best joint positions inside the limits that least squares find,
    in one search from each start. The last call of `error` is with these positions, so that the
    robot is placed there.

    Args:
        robot: The robot, with its joint limits.
        error: Function that places the robot at joint positions (n,) and returns their error (m,).
        starts: Joint positions (n,) [m or rad] at which the searches begin.
        slopes: Function that returns the derivative (m, n) of `error`; None: finite differences.
        steps: Most steps of one search; None: SciPy's own limit.
    """
    from scipy.optimize import least_squares  # only now: it takes a second

    bounds = robot.lower, robot.upper
    inside = (np.clip(start, *bounds) for start in starts)
    derived: dict[str, Any] = {} if slopes is None else {"jac": slopes}
    found = [least_squares(error, q, bounds=bounds, max_nfev=steps, **derived) for q in inside]
    return error(min(found, key=lambda f: f.cost).x)


def comfort(robot: Robot, data: mujoco.MjData) -> float:
    """Return a score of the joint positions in `data`, higher for better ones: the smallest
    distance of a joint from a limit, but at most 1 [rad or m], times the smallest singular value of
    the robot's Jacobian. The score is divided by 100 if a link is in the camera's view or below the
    table's top.
    """
    q = data.qpos[robot.qpos]
    room = np.minimum(q - robot.lower, robot.upper - q).min()
    # The smallest singular value: the slowest camera motion for joint rates of length 1.
    weakest = np.linalg.svd(robot.jacobian(data), compute_uv=False)[-1]
    links = data.xpos[robot.model.jnt_bodyid[robot.ids]]
    x, y, z = robot.camera(data).inverse().apply(links).T
    seen = (z > 0) & (np.hypot(x, y) < VIEW * z)
    hidden = seen.any() or (links[:, 2] < 0).any()
    return float(min(room, COMFORT) * weakest) * (0.01 if hidden else 1.0)
