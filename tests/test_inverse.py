"""From a camera twist to joint rates: accelerations and limits of joints, and the freedom of seven."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from dark import Dark
from measured import measured_run
from scipy.optimize import linprog

from servo.loop.episode import Episode
from servo.scenario.load import load
from sim.camera.camera import CameraConfig
from sim.geometry import exp_so3
from sim.kinematics.drives import random_joints
from sim.kinematics.robot import NEAR_LIMIT, Inversion, Robot
from sim.models.assembly import build_model
from sim.motions import still
from sim.mounting import CameraInHand, TargetInHand
from sim.robots import gantry, mjcf
from sim.targets import car
from sim.types import Pose
from sim.world import World, WorldConfig, WorldParts

IN_HAND = CameraInHand()
STANDS = TargetInHand(
    Pose(exp_so3(np.array([2.0, 0.5, -1.0])), np.array([0.4, -0.9, 0.7])),
    Pose(exp_so3(np.array([0.3, -0.2, 0.9])), np.array([0.02, 0.1, 0.3])),
)
BENT = np.array([0.3, 0.6, 0.4, 1.2, 0.5, 0.8, 0.2])
TICK = 1 / 120
TWIST = np.array([0.3, -0.2, 0.1, 0.2, 0.3, -0.4])


def built(kind, stands=IN_HAND, inversion=None, **settings):
    """The robot, in a posture far from limits and singular poses."""
    rng = np.random.default_rng(0)
    design = replace(kind.Config(**settings).build(rng), mounting=stands)
    design = replace(design, inversion=inversion or design.inversion)
    model = build_model(480.0, CameraConfig(), design, car.Config().build(rng))
    robot = Robot(model, design)
    data = mujoco.MjData(model)
    return robot, at(robot, data, BENT if kind is mjcf else BENT[:6] / 2)


def at(robot, data, q):
    data.qpos[robot.qpos] = q
    robot.refresh(data)
    return data


@pytest.mark.parametrize("stands", [IN_HAND, STANDS])
@pytest.mark.parametrize("kind", [gantry, mjcf])
def test_the_gradient_of_the_manipulability_agrees_with_finite_differences(kind, stands):
    robot, data = built(kind, stands)
    q, step = robot.joints(data), 1e-6
    logarithms = []
    for d in step * np.eye(len(q)):
        Js = [robot.jacobian(at(robot, data, end)) for end in (q + d, q - d)]
        ahead, back = (np.linalg.slogdet(J @ J.T)[1] / 2 for J in Js)
        logarithms.append((ahead - back) / (2 * step))
    J = robot.jacobian(at(robot, data, q))
    found = robot.manipulability_gradient(J, np.linalg.pinv(J))
    np.testing.assert_allclose(found, logarithms, atol=1e-6)
    assert np.abs(found).max() > 0.1


def test_a_redundant_arm_leaves_a_singular_pose_without_moving_the_camera():
    """Shoulder and wrist are bent little, so their first and last axes are nearly one."""
    robot, data = built(mjcf, inversion=Inversion(centring=0.0, manipulability=0.5))
    at(robot, data, [0.3, 0.1, 0.9, 1.2, 0.9, 0.2, 0.2])
    eye = robot.eye(data)
    volumes = []
    for _ in range(100):
        J = robot.jacobian(data)
        volumes.append(np.sqrt(np.linalg.det(J @ J.T)))
        rates, _, limited = robot.rates(data, np.zeros(6))
        assert not limited
        at(robot, data, robot.joints(data) + 0.01 * rates)
    assert np.diff(volumes).min() > -1e-9
    assert volumes[-1] > 1.15 * volumes[0]
    np.testing.assert_allclose(robot.eye(data).translation, eye.translation, atol=5e-3)


@pytest.mark.wide
@pytest.mark.parametrize("weight", [0.0, 1.0, 10.0])
def test_no_self_motion_takes_a_joint_to_its_limit(weight):
    """From ten postures, whatever the joints like together."""
    robot, data = built(mjcf, inversion=Inversion(manipulability=weight))
    low, high = np.nan_to_num([robot.lower, robot.upper], posinf=1e9, neginf=-1e9)
    middles = (low + high) / 2
    halves = (high - low) / 2
    for begin in random_joints(robot.model, robot.ids, np.random.default_rng(1), 10):
        q = begin
        shares = []
        for _ in range(300):
            shares.append(np.max(np.abs(q - middles) / halves))
            q = q + 0.01 * robot.rates(at(robot, data, q), np.zeros(6))[0]
        assert max(shares) < max(shares[0], 1.0 - NEAR_LIMIT) + 1e-3


def longest(J, twist, most):
    """The largest share of a twist that rates up to this make, by linear programming."""
    equal = np.column_stack([J, -twist])
    bounds = [(-most, most)] * J.shape[1] + [(0, 1)]
    return linprog([0.0] * J.shape[1] + [-1.0], A_eq=equal, b_eq=np.zeros(6), bounds=bounds).x[-1]


@pytest.mark.parametrize(
    ("robot", "noise"), [("gantry", 0.0), ("gantry", 1e-5), ("mjcf", 0.0), ("free", 0.0)]
)
def test_no_tick_of_a_closed_loop_exceeds_the_acceleration(robot, noise):
    most = 0.6
    changes = [
        f"robot.kind={robot}",
        f"robot.acceleration={most}",
        f"robot.encoder_noise={noise}",
        "world.drive_rate=30",
        "start.x=40",
        "run.duration=4",
        "tracker.kind=truth",
    ]
    with Episode(load("arm7_line", changes), seen=False) as episode:
        # While the first step is shown, two ticks are past.
        rates = [episode.world.data.ctrl.copy() for _ in episode]
    change = np.abs(np.diff(rates, axis=0))
    assert change.max() <= most / 30 + 1e-12
    assert (np.abs(rates[0]) <= 2 * most / 30 + 1e-12).all()
    # At first it is the limit that decides, and at last the car's speed.
    np.testing.assert_allclose(change.max(axis=1)[:3], most / 30, rtol=1e-6)
    assert change[-30:].max() < most / 60


@pytest.mark.parametrize("size", [0.02, 1.0])
@pytest.mark.parametrize("kind", [gantry, mjcf])
def test_from_rest_a_twist_keeps_its_direction_and_is_as_long_as_accelerations_allow(kind, size):
    """However much faster the joints would like to be in the middle."""
    robot, data = built(kind, inversion=Inversion(centring=20.0), acceleration=2.0 * size)
    J = robot.jacobian(data)
    rates, made, limited = robot.rates(data, size * TWIST, TICK, np.zeros(len(robot.names)))
    assert limited
    assert np.abs(rates).max() <= 2.0 * size * TICK
    share = longest(J, TWIST, 2.0 * TICK)
    np.testing.assert_allclose(made, share * size * TWIST, atol=5e-6)


def test_an_acceleration_that_excludes_the_direction_is_used_up_to_turn():
    """The gantry moves along x and is to move along y: both as fast as it can."""
    robot, data = built(gantry, acceleration=(2.0, 3.0, 1.0, 1.0, 1.0, 1.0))
    at(robot, data, np.zeros(6))
    before = np.array([0.4, 0.0, 0.0, 0.0, 0.0, 0.0])
    across = robot.jacobian(data)[:, 1]
    rates, _, limited = robot.rates(data, 0.5 * across, TICK, before)
    assert limited == ("x (acceleration)", "y (acceleration)")
    np.testing.assert_allclose(rates, [0.4 - 2 * TICK, 3 * TICK, 0, 0, 0, 0], atol=1e-6)


def test_a_redundant_arm_that_is_too_slow_keeps_the_direction_with_all_its_freedom():
    robot, data = built(mjcf, speed=(0.3,))
    fast = np.array([0.0, 0.0, 0.0, 3.0, -2.0, 4.0])
    J = robot.jacobian(data)
    _, made, limited = robot.rates(data, fast)
    assert limited
    share = longest(J, fast, 0.3)
    np.testing.assert_allclose(made, share * fast, atol=5e-6)
    # All joints slowed together are slower.
    assert share > 1.02 * 0.3 / np.abs(np.linalg.pinv(J) @ fast).max()


@pytest.mark.parametrize("acceleration", [0.5, 2.0])
def test_a_joint_stops_before_its_limit(acceleration):
    rng = np.random.default_rng(0)
    robot = gantry.Config(acceleration=acceleration).build(rng)
    motion, target = still.Config().build(rng), car.Config().build(rng)
    parts = WorldParts(robot, target, motion, config=WorldConfig(drive_rate=30.0))
    world = World(parts, rng, renderer=Dark)
    assert world.start(np.array([160.0, 120.0]), 0.0, 1.0)
    upper = world.robot.upper[0]
    along, rates = [], [0.0]
    for _ in range(240):
        twist = 0.7 * world.posture().jacobian[:, 0]
        world.step(twist)
        along.append(world.posture().joints[0])
        rates.append(world.data.ctrl[0])
    assert np.abs(np.diff(rates)).max() <= acceleration / 30 + 1e-12
    assert max(rates) > 0.5
    assert upper - 0.02 < max(along) < upper


def test_an_acceleration_that_is_never_reached_changes_no_bit():
    joints = []
    for more in ([], ["robot.acceleration=1e4"]):
        steps, _ = measured_run(load("line", ["run.duration=2", "tracker.kind=truth", *more]))
        joints.append(np.array([step.posture.joints for step in steps]))
    np.testing.assert_array_equal(*joints)
