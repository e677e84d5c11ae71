"""The contracts of what is in the world: robots, targets, motions, disturbances."""

# pyright: reportAttributeAccessIssue=false
# MuJoCo's names come from compiled modules without stubs.
from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from servo.testing._given import BrokenContract, built, config_of, contract, require
from sim.camera.camera import CameraConfig
from sim.disturbances import KINDS as DISTURBANCES
from sim.geometry import log_se3
from sim.models.assembly import TARGET, build_model
from sim.models.target import Target
from sim.motions import KINDS as MOTIONS
from sim.robot.design import Design
from sim.robot.robot import Robot
from sim.robots import KINDS as ROBOTS
from sim.targets import KINDS as TARGETS
from sim.types import Array, Effect, Pose

PHYSICS_RATE = 480.0
TIMES = (-0.1, 0.0, 0.4, 1.0, 2.5, 10.0)
"""Moments to ask for [s]; one frame before the start is asked for in every run."""
SOON = 1e-3
NEAR = 0.01
"""In this time [s] nothing on the table moves farther than this [m]: it has no jumps."""
STEP = 1e-6
LARGEST = 2.0
SMALLEST = 1e-3
"""Sides of a reference rectangle [m]."""


@contract
def check_motion(motion: Any) -> None:
    """Check that a motion keeps the contract of `sim.stage.Motion`.

    Raises:
        BrokenContract: It does not; the sentence says what to change.
    """
    config = config_of(MOTIONS, motion)
    once, again = (built(config, ("at",), seed=4) for _ in range(2))
    for time in TIMES:
        pose = once.at(time)
        require(isinstance(pose, Pose), f"at({time:g}) returned {type(pose).__name__}, not a Pose")
        R = np.asarray(pose.rotation)
        t = np.asarray(pose.translation)
        shaped = R.shape == (3, 3) and t.shape == (3,) and np.isfinite(t).all()
        turned = shaped and np.allclose(R @ R.T, np.eye(3), atol=1e-9) and np.linalg.det(R) > 0
        require(turned, f"at({time:g}) is no pose: a rotation (3, 3) and a translation (3,)")
        same = np.array_equal(t, again.at(time).translation)
        require(same, "the same generator gave another motion; draw from build(rng) only")
        jump = float(np.linalg.norm(once.at(time + SOON).translation - t))
        require(jump < NEAR, f"at({time:g}) jumps by {jump:.3g} m within a millisecond")


@contract
def check_disturbance(disturbance: Any) -> None:
    """Check that a disturbance keeps the contract of `sim.stage.Disturbance`.

    Raises:
        BrokenContract: It does not; the sentence says what to change.
    """
    found = built(config_of(DISTURBANCES, disturbance), ("at",))
    require(
        isinstance(getattr(found, "props", None), tuple),
        "it has no tuple `props`; () if it needs nothing in the scene",
    )
    require(found.at(-1.0) == Effect(), "it does something before time 0; return Effect() there")
    for time in TIMES:
        effect = found.at(time)
        kind = type(effect).__name__
        require(isinstance(effect, Effect), f"at({time:g}) returned {kind}; return an Effect")


@contract
def check_robot(robot: Any) -> None:
    """Check that a robot keeps the contract of `sim.robot.robot.Design`: it can be put into the
    room, and its joints move the camera as its Jacobian says.

    Raises:
        BrokenContract: It does not; the sentence says what to change.
    """
    design = built(config_of(ROBOTS, robot), ())
    kind = type(design).__name__
    require(isinstance(design, Design), f"build(rng) gave {kind}; return a Design")
    try:
        model = _scene(robot=design)
        machine = Robot(model, design)
        data = mujoco.MjData(model)
    except (ValueError, KeyError) as error:
        raise BrokenContract(f"it cannot be put into the room: {error}") from error
    for home in design.homes:
        n = len(machine.names)
        require(len(home) == n, f"a home has {len(home)} joints; the robot has {n}")
        _check_jacobian(machine, data, model, np.array(home, dtype=float))


def _check_jacobian(machine: Robot, data: Any, model: Any, home: Array) -> None:
    def eye(q: Array) -> Pose:
        for name, value in zip(machine.names, q.tolist(), strict=True):
            data.joint(f"robot/{name}").qpos[:] = value
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        return machine.posture(data, np.zeros(6)).T_base_camera

    found = [
        log_se3(eye(home - d).inverse() @ eye(home + d)) / (2 * STEP)
        for d in STEP * np.eye(len(home))
    ]
    eye(home)
    wrong = float(np.abs(machine.jacobian(data) - np.column_stack(found)).max())
    require(
        wrong < 1e-5, f"its Jacobian differs by {wrong:.3g} from how the joints move the camera"
    )


@contract
def check_target(target: Any) -> None:
    """Check that a target keeps the contract of `sim.models.target.Target`: it can be put into the
    room, moves as one, and its reference rectangle is on it.

    Raises:
        BrokenContract: It does not; the sentence says what to change.
    """
    found = built(config_of(TARGETS, target), ())
    kind = type(found).__name__
    require(isinstance(found, Target), f"build(rng) gave {kind}; return a Target")
    outline = np.asarray(found.outline)
    shaped = outline.shape == (4, 3) and np.isfinite(outline).all()
    require(shaped, "the outline is not four corners (4, 3) of finite numbers")
    require(np.ptp(outline[:, 2]) == 0, "the outline is not level: its corners differ in height")
    (a, b) = np.ptp(outline[:, :2], axis=0)
    right = outline[1, 0] > outline[0, 0]
    require(
        right and outline[0, 1] > outline[3, 1],
        "the outline's corners are in another order: "
        "from (-x, +y) over (+x, +y) and (+x, -y) to (-x, -y)",
    )
    sized = min(a, b) >= SMALLEST and max(a, b) <= LARGEST
    require(sized, f"the outline is {a:g} x {b:g} m; its sides go from {SMALLEST:g} to {LARGEST:g}")
    try:
        model = _scene(target=found)
    except (ValueError, KeyError) as error:
        raise BrokenContract(f"it cannot be put into the room: {error}") from error
    _check_moves(model)


def _check_moves(model: Any) -> None:
    data = mujoco.MjData(model)
    body = model.body(TARGET)
    own = model.body_rootid[model.geom_bodyid] == body.id
    require(own.any(), "its model has no geoms, so there is nothing to see")
    mujoco.mj_kinematics(model, data)
    before = data.geom_xpos[own].copy()
    data.mocap_pos[body.mocapid[0]] = (0.1, 0.2, 0.0)
    mujoco.mj_kinematics(model, data)
    moved = np.allclose(data.geom_xpos[own] - before, (0.1, 0.2, 0.0), atol=1e-9)
    require(moved, "some of its geoms stay behind when the target moves; it may have no joints")


def _scene(robot: Design | None = None, target: Target | None = None) -> Any:
    from sim.robots import gantry
    from sim.targets import car

    rng = np.random.default_rng(0)
    robot = robot or gantry.Config().build(rng)
    target = target or car.Config().build(rng)
    return build_model(PHYSICS_RATE, CameraConfig(), robot, target)
