import mujoco
import numpy as np
import pytest

from sim.geometry import log_se3
from sim.render import CameraConfig, camera_pose
from sim.robot import EYE, Robot
from sim.world import build_model


@pytest.fixture
def robot():
    model = build_model(480.0, CameraConfig())
    data = mujoco.MjData(model)
    return Robot(model), model, data


def pose_at(model, data, q):
    data.qpos[:] = q
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_camlight(model, data)
    return camera_pose(data, model.camera(EYE).id)


@pytest.mark.parametrize("seed", range(5))
def test_jacobian_agrees_with_finite_differences(robot, seed):
    machine, model, data = robot
    q = np.random.default_rng(seed).uniform(-0.5, 0.5, 6)
    h, J = 1e-6, np.zeros((6, 6))
    for i in range(6):
        forward, back = (pose_at(model, data, q + s * h * np.eye(6)[i]) for s in (1, -1))
        J[:, i] = log_se3(back.inverse() @ forward) / (2 * h)
    pose_at(model, data, q)
    np.testing.assert_allclose(machine.jacobian(data), J, atol=1e-8)


def test_rates_make_the_twist(robot):
    machine, model, data = robot
    pose_at(model, data, np.array([0.1, -0.2, 0.1, 0.7, 0.2, -0.1]))
    twist = np.array([0.1, 0.05, -0.02, 0.1, -0.2, 0.3])
    rates, limited = machine.rates(data, twist)
    assert not limited
    np.testing.assert_allclose(machine.jacobian(data) @ rates, twist, atol=1e-5)


def test_saturation_keeps_the_direction(robot):
    machine, model, data = robot
    pose_at(model, data, np.zeros(6))
    twist = np.array([4.0, 1.0, 0.0, 0.0, 0.0, 1.0])
    rates, limited = machine.rates(data, twist)
    made = machine.jacobian(data) @ rates
    assert limited
    np.testing.assert_allclose(
        made / np.linalg.norm(made), twist / np.linalg.norm(twist), atol=1e-6
    )
    assert np.max(np.abs(rates) / machine.fastest) == pytest.approx(1.0)


def test_a_joint_slows_down_before_its_limit_and_leaves_it_freely(robot):
    machine, model, data = robot
    pose_at(model, data, np.array([1.3 - 0.02, 0.0, 0.0, 0.0, 0.0, 0.0]))
    towards, limited = machine.rates(data, np.array([0.5, 0.0, 0.0, 0.0, 0.0, 0.0]))
    assert limited
    assert towards[0] == pytest.approx(8.0 * 0.01)  # STOP_GAIN times the room above STOP_MARGIN
    away, limited = machine.rates(data, np.array([-0.5, 0.0, 0.0, 0.0, 0.0, 0.0]))
    assert not limited
    assert away[0] == pytest.approx(-0.5, rel=1e-4)


def test_solve_finds_the_joints_of_a_pose(robot):
    machine, model, data = robot
    q = np.array([0.3, -0.4, 0.2, 1.0, 0.3, -0.2])
    wanted = pose_at(model, data, q)
    data.qpos[:] = 0.0
    assert machine.solve(data, wanted)
    np.testing.assert_allclose(machine.joints(data), q, atol=1e-8)


def test_the_wrist_turns_without_end_and_the_axes_do_not(robot):
    machine, _, _ = robot
    assert machine.names == ("x", "y", "z", "yaw", "pitch", "roll")
    assert machine.units == ("m", "m", "m", "rad", "rad", "rad")
    np.testing.assert_array_equal(np.isfinite(machine.upper), [True, True, True, False, True, True])
