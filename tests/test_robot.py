from dataclasses import replace
from math import sqrt

import mujoco
import numpy as np
import pytest

from sim.camera.camera import CameraConfig
from sim.camera.renderer import camera_pose
from sim.geometry import log_se3
from sim.kinematics.inverse_kinematics import reach
from sim.kinematics.robot import CAMERA, STOP_MARGIN, Inversion, Robot, damped_inverse
from sim.models.assembly import build_model
from sim.robots import arm, gantry
from sim.targets import car


def built(kind, **settings):
    design = kind.Config(**settings).build(np.random.default_rng(0))
    target = car.Config().build(np.random.default_rng(0))
    model = build_model(480.0, CameraConfig(), design, target)
    return Robot(model, design), model, mujoco.MjData(model)


@pytest.fixture
def robot():
    return built(gantry)


def pose_at(model, data, q):
    data.qpos[:] = q
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_camlight(model, data)
    return camera_pose(data, model.camera(CAMERA).id)


@pytest.mark.parametrize("kind", [gantry, arm])
@pytest.mark.parametrize("seed", range(5))
def test_jacobian_agrees_with_finite_differences(kind, seed):
    machine, model, data = built(kind)
    q = np.random.default_rng(seed).uniform(-0.5, 0.5, 6)
    h, J = 1e-6, np.zeros((6, 6))
    for i in range(6):
        forward, back = (pose_at(model, data, q + s * h * np.eye(6)[i]) for s in (1, -1))
        J[:, i] = log_se3(back.inverse() @ forward) / (2 * h)
    pose_at(model, data, q)
    np.testing.assert_allclose(machine.jacobian(data), J, atol=1e-8)


def test_the_inverse_is_exact_where_it_can_be_and_bounded_where_it_cannot():
    rng, drives = np.random.default_rng(0), Inversion(weakest=0.1, damping=0.1)
    U, V = (np.linalg.qr(rng.normal(size=(6, 6)))[0] for _ in range(2))
    strong, weak = (U @ np.diag([1, 1, 1, 1, 1, s]) @ V.T for s in (0.2, 1e-9))
    np.testing.assert_allclose(damped_inverse(strong, drives) @ strong, np.eye(6), atol=1e-12)
    # Nakamura and Hanafusa: at s = 0 the other directions lose damping^2, this one moves nothing.
    kept = U.T @ weak @ damped_inverse(weak, drives) @ U
    np.testing.assert_allclose(np.diag(kept), [1 / 1.01] * 5 + [0.0], atol=1e-6)
    assert np.linalg.norm(damped_inverse(weak, drives), 2) < 1.0


def test_the_posture_tells_pose_twist_joints_and_down(robot):
    machine, model, data = robot
    pose = pose_at(model, data, np.array([0.1, -0.2, 0.1, 0.7, 0.2, -0.1]))
    posture = machine.posture(data, np.arange(6.0))
    np.testing.assert_allclose(posture.T_base_camera.rotation, pose.rotation, atol=1e-12)
    np.testing.assert_allclose(pose.rotation @ posture.down, [0, 0, -1], atol=1e-12)
    np.testing.assert_array_equal(posture.joints, [0.1, -0.2, 0.1, 0.7, 0.2, -0.1])
    np.testing.assert_array_equal(posture.twist, np.arange(6.0))
    assert posture.upper[0] == 1.3


def test_rates_make_the_twist(robot):
    machine, model, data = robot
    pose_at(model, data, np.array([0.1, -0.2, 0.1, 0.7, 0.2, -0.1]))
    twist = np.array([0.1, 0.05, -0.02, 0.1, -0.2, 0.3])
    rates, _, limited = machine.rates(data, twist)
    assert not limited
    np.testing.assert_allclose(machine.jacobian(data) @ rates, twist, atol=1e-12)


def test_saturation_keeps_the_direction(robot):
    machine, model, data = robot
    pose_at(model, data, np.zeros(6))
    twist = np.array([4.0, 1.0, 0.0, 0.0, 0.0, 1.0])
    rates, _, limited = machine.rates(data, twist)
    made = machine.jacobian(data) @ rates
    assert limited == ("x (speed)", "y (speed)")
    np.testing.assert_allclose(
        made / np.linalg.norm(made), twist / np.linalg.norm(twist), atol=1e-6
    )
    assert np.max(np.abs(rates) / machine.fastest) == pytest.approx(1.0)


def test_a_joint_slows_down_before_its_limit_and_leaves_it_freely(robot):
    machine, model, data = robot
    pose_at(model, data, np.array([1.3 - 0.02, 0.0, 0.0, 0.0, 0.0, 0.0]))
    towards, _, limited = machine.rates(data, np.array([0.5, 0.0, 0.0, 0.0, 0.0, 0.0]))
    assert limited == ("x (range)",)
    assert towards[0] == pytest.approx(8.0 * 0.01)  # STOP_GAIN times the room above STOP_MARGIN
    away, _, limited = machine.rates(data, np.array([-0.5, 0.0, 0.0, 0.0, 0.0, 0.0]))
    assert not limited
    assert away[0] == pytest.approx(-0.5, rel=1e-4)


@pytest.mark.parametrize(
    ("room", "rate"),
    [
        (0.01, 8.0 * 0.01),
        (0.04, sqrt(2.0 * (0.04 - 2.0 / 256))),
        (0.09, sqrt(2.0 * (0.09 - 2.0 / 256))),
    ],
)
def test_a_joint_brakes_by_half_its_acceleration_and_then_exponentially(room, rate):
    machine, model, data = built(gantry, acceleration=2.0)
    pose_at(model, data, np.array([1.3 - STOP_MARGIN - room, 0.0, 0.0, 0.0, 0.0, 0.0]))
    towards, _, limited = machine.rates(data, np.array([0.5, 0.0, 0.0, 0.0, 0.0, 0.0]))
    assert limited == ("x (range)",)
    assert towards[0] == pytest.approx(rate)


def test_solve_finds_the_joints_of_a_pose(robot):
    machine, model, data = robot
    q = np.array([0.3, -0.4, 0.2, 1.0, 0.3, -0.2])
    wanted = pose_at(model, data, q)
    data.qpos[:] = 0.0
    assert reach(machine, data, wanted)
    np.testing.assert_allclose(machine.joints(data), q, atol=1e-8)


@pytest.mark.wide
def test_a_pose_is_reached_up_to_the_limits_of_the_joints_and_not_beyond(robot, monkeypatch):
    machine, model, data = robot
    wanted = pose_at(model, data, np.array([0.3, -0.4, 0.2, 1.0, 0.3, -0.2]))
    assert reach(machine, data, wanted)
    q = machine.joints(data).copy()
    for side, beyond in (("lower", 1e-6), ("upper", -1e-6)):
        with monkeypatch.context() as limits:
            limits.setattr(machine, side, q)
            assert reach(machine, data, wanted)
            limits.setattr(machine, side, q + beyond)
            assert not reach(machine, data, wanted)
    far = replace(wanted, translation=wanted.translation + 9.0)
    assert not reach(machine, data, far)


@pytest.mark.parametrize(
    "joints",
    [
        (-0.34884914, -0.79779541, 1.45782922, -0.70580543, -0.22498014, 2.92626523),
        (-0.3198438, -0.87600716, 1.61800374, -0.74225878, -0.27581517, 3.19487156),
        (0.34880187, -0.62118884, 1.23810459, -0.54689506, -0.06332542, -2.80806771),
    ],
)
def test_a_pose_in_the_middle_of_the_arms_ranges_is_found(joints):
    """Quadratic programs alone ended half a metre beside it, from everywhere."""
    machine, model, data = built(arm)
    assert reach(machine, data, pose_at(model, data, joints))


def test_the_wrist_turns_without_end_and_the_axes_do_not(robot):
    machine, _, _ = robot
    assert machine.names == ("x", "y", "z", "yaw", "pitch", "roll")
    assert machine.units == ("m", "m", "m", "rad", "rad", "rad")
    np.testing.assert_array_equal(np.isfinite(machine.upper), [True, True, True, False, True, True])
