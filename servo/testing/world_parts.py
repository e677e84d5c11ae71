"""Checks whether robots, targets, motions and disturbances work as servobench needs them to."""

# pyright: reportAttributeAccessIssue=false
# MuJoCo's names come from compiled modules without stubs.
from typing import Any

import mujoco
import numpy as np

from servo.contracts import BrokenContract, require
from servo.testing._subject import built, config_of, contract
from sim.camera.camera import CameraConfig
from sim.geometry import log_se3
from sim.kinematics.robot import Design, Robot
from sim.models.assembly import TARGET, build_model
from sim.models.target import Target
from sim.outline import Outline
from sim.types import Array, Pose

PHYSICS_RATE = 480.0
TIMES = (-0.1, 0.0, 0.4, 1.0, 2.5, 10.0)
"""Test times [s]; every run asks for one frame before its start."""
SOON = 1e-3
"""Time between two compared positions of a target [s]."""
NEAR = 0.01
"""Largest distance that a target may move in that time [m], at 10 m/s."""
STEP = 1e-6
"""Step of the finite differences of a Jacobian [rad or m]."""
LONGEST_SIDE = 2.0
"""Longest side of a reference rectangle [m]."""
SHORTEST_SIDE = 1e-3
"""Shortest side of a reference rectangle [m]."""


@contract
def check_motion(motion: object) -> None:
    """Check a motion of the target (`sim.stage.Motion`) at six times from -0.1 to 10 s: valid
    poses, a position that changes by less than 0.01 m in a millisecond, and the same positions when
    it is built again with the same random numbers.

    Args:
        motion: A settings class `Config` or its instance, the name of a shipped kind such as
            "line", or "module:Name".

    Example:
        >>> check_motion("line")

    Raises:
        BrokenContract: The motion breaks its contract; the message says what to change.
    """
    config = config_of("motion", motion)
    once, again = (built("motion", config) for _ in range(2))
    for time in TIMES:
        pose = once.at(time)
        same = np.array_equal(pose.translation, again.at(time).translation)
        require(same, "the same generator gave another motion; draw from build(rng) only")
        jump = float(np.linalg.norm(once.at(time + SOON).translation - pose.translation))
        require(
            jump < NEAR,
            f"at({time:g}) jumps by {jump:.3g} m within a millisecond: make the motion continuous",
        )


@contract
def check_disturbance(disturbance: object) -> None:
    """Check that a disturbance works as `sim.stage.Disturbance` requires: valid effects at six
    times from -0.1 to 10 s, and no effect before time 0.

    Args:
        disturbance: A settings class `Config` or its instance, the name of a shipped kind, or
            "module:Name".

    Raises:
        BrokenContract: The disturbance breaks its contract; the message says what to change.
    """
    found = built("disturbances", config_of("disturbances", disturbance))
    for time in TIMES:
        found.at(time)


@contract
def check_robot(robot: object) -> None:
    """Check that a robot works as `sim.kinematics.robot.Design` requires: its model can be added to
    the simulated room, and at each of its home positions its Jacobian agrees with finite
    differences of its camera pose.

    Args:
        robot: A settings class `Config` or its instance, the name of a shipped kind, or
            "module:Name".

    Raises:
        BrokenContract: The robot breaks its contract; the message says what to change.
    """
    design: Design = built("robot", config_of("robot", robot))
    model = _scene(robot=design)
    machine = Robot(model, design)
    data = mujoco.MjData(model)
    for home in design.homes:
        n = len(machine.names)
        require(len(home) == n, f"a home has {len(home)} joints; the robot has {n}")
        _check_jacobian(machine, data, np.array(home, dtype=float))


def _check_jacobian(machine: Robot, data: Any, home: Array) -> None:
    """Compare a robot's Jacobian at joint positions `home` (n,) [rad or m] with finite differences
    of its camera pose; `data` is an `MjData`, which is changed.
    """

    def camera_at(q: Array) -> Pose:
        """Move the joints to positions (n,), and return T_base_camera."""
        for name, value in zip(machine.names, q.tolist(), strict=True):
            data.joint(f"robot/{name}").qpos[:] = value
        machine.refresh(data)
        return machine.posture(data, np.zeros(6)).T_base_camera

    found = [
        log_se3(camera_at(home - d).inverse() @ camera_at(home + d)) / (2 * STEP)
        for d in STEP * np.eye(len(home))
    ]
    camera_at(home)
    wrong = float(np.abs(machine.jacobian(data) - np.column_stack(found)).max())
    require(
        wrong < 1e-5,
        f"the Jacobian of the robot differs by {wrong:.3g} from finite differences of the "
        "camera pose",
    )


@contract
def check_target(target: object) -> None:
    """Check that a target works as `sim.models.target.Target` requires: its model can be added to
    the simulated room, has geoms, moves as one rigid body, and has a level reference rectangle with
    the right order of corners and sides from 1 mm to 2 m.

    Args:
        target: A settings class `Config` or its instance, the name of a shipped kind, or
            "module:Name".

    Raises:
        BrokenContract: The target breaks its contract; the message says what to change.
    """
    found: Target = built("target", config_of("target", target))
    outline = found.outline
    a = Outline(outline).length
    b = Outline(outline).width
    require(
        (outline[1, 0] > outline[0, 0]) and outline[0, 1] > outline[3, 1],
        "the outline's corners are in the wrong order; order them from (-x, +y) over (+x, +y) and "
        "(+x, -y) to (-x, -y)",
    )
    sized = min(a, b) >= SHORTEST_SIDE and max(a, b) <= LONGEST_SIDE
    limits = f"{SHORTEST_SIDE:g} to {LONGEST_SIDE:g}"
    require(sized, f"the outline is {a:g} x {b:g} m; its sides have to be from {limits}")
    model = _scene(target=found)
    data = mujoco.MjData(model)
    body = model.body(TARGET)
    own = model.body_rootid[model.geom_bodyid] == body.id
    require(own.any(), "the target's model has no geoms, so that no picture would show it")
    mujoco.mj_kinematics(model, data)
    before = data.geom_xpos[own].copy()
    data.mocap_pos[body.mocapid[0]] = (0.1, 0.2, 0.0)
    mujoco.mj_kinematics(model, data)
    moved = np.allclose(data.geom_xpos[own] - before, (0.1, 0.2, 0.0), atol=1e-9)
    require(
        moved, "some geoms stay behind when the target moves; remove joints of the target's model"
    )


def _scene(robot: Design | None = None, target: Target | None = None) -> Any:
    """Return the `MjModel` of the room with a robot and a target, by default gantry and car.

    Raises:
        BrokenContract: The model of the robot or the target cannot be added to the room.
    """
    from sim.robots import gantry
    from sim.targets import car

    rng = np.random.default_rng(0)
    robot = robot or gantry.Config().build(rng)
    target = target or car.Config().build(rng)
    try:
        return build_model(PHYSICS_RATE, CameraConfig(), robot, target)
    except (ValueError, KeyError) as error:
        raise BrokenContract(
            f"the model of the robot or the target cannot be added to the room; correct it: {error}"
        ) from error
