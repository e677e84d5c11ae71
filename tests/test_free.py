"""The free camera: exact twists at any tilt, and starts under a tilt or at a pose."""

import mujoco
import numpy as np
import pytest
from dark import Dark

from servo.controllers import hold
from servo.loop.episode import Episode
from servo.loop.run_measures import summarise
from servo.mistake import Mistake
from servo.scenario.load import load
from servo.types import Command
from sim.camera.camera import CameraConfig
from sim.geometry import exp_se3, exp_so3, log_se3, tilt
from sim.kinematics.inverse_kinematics import reach
from sim.motions import still
from sim.placement import DOWN, check_sight
from sim.robots import free
from sim.targets import plate
from sim.types import Pose
from sim.world import World, WorldParts

RNG = np.random.default_rng()
TARGET = still.Config(x=0.2, y=-0.1, heading_deg=30.0).build(RNG)


@pytest.fixture(scope="module")
def world():
    camera = CameraConfig(width=640, height=480, fx=600.0, rate=25.0)
    robot, target = free.Config().build(RNG), plate.Config(width=0.1).build(RNG)
    return World(WorldParts(robot, target, TARGET, camera=camera), RNG, renderer=Dark)


def seen(world):
    """The target in the camera's frame, its own like the camera's where it is faced."""
    truth = world.truth()
    middle = Pose(DOWN, world.outline.mean(axis=0))
    return truth.T_world_camera.inverse() @ truth.T_world_target @ middle


def test_twists_are_exact_at_any_tilt(world):
    rng = np.random.default_rng(0)
    for _ in range(40):
        axis, turn = rng.uniform(-np.pi, np.pi, 2)
        tilted = np.radians(rng.uniform(0, 80)) * np.array([np.cos(axis), np.sin(axis), 0.0])
        R = exp_so3(tilted) @ DOWN @ exp_so3(np.array([0.0, 0.0, turn]))
        assert reach(world.robot, world.data, Pose(R, rng.uniform(0.5, 4.0, 3)))
        world.data.qvel[:] = 0
        mujoco.mj_forward(world.model, world.data)
        world._eye_at = world._set_stage(0.0)
        v, w = rng.normal(size=(2, 3))
        twist = np.concatenate([3 * v / np.linalg.norm(v), 4 * w / np.linalg.norm(w)])
        assert not world.step(twist)
        np.testing.assert_allclose(world.posture().twist, twist, atol=1e-3)


def test_a_twist_holds_through_many_frames_and_no_speed_is_too_high(world):
    assert world.start(np.array([320.0, 240.0]), 0.0, 1.0)
    place = world.truth().T_world_camera
    twist = np.array([40.0, 0.0, -30.0, 0.0, 5.0, 20.0])
    for _ in range(5):
        assert not world.step(twist)
        place = place @ exp_se3(twist / 25)
    off = log_se3(place.inverse() @ world.truth().T_world_camera)
    assert np.abs(off).max() < 1e-3


@pytest.mark.parametrize("towards", [0.0, 70.0, 180.0, -90.0])
@pytest.mark.parametrize("angle", [0.0, 30.0, 60.0])
def test_a_tilt_keeps_the_centre_where_it_is_seen(world, angle, towards):
    pixel, theta, depth = np.array([400.0, 200.0]), 0.5, 1.2
    assert world.start(pixel, theta, depth)
    before = seen(world)
    assert world.start(pixel, theta, depth, np.radians(angle), np.radians(towards))
    np.testing.assert_allclose(world.truth().centre, pixel, atol=1e-6)
    np.testing.assert_allclose(seen(world).translation, before.translation, atol=1e-9)
    R = world.truth().T_world_camera.rotation
    assert np.degrees(tilt(R)) == pytest.approx(angle, abs=1e-6)


@pytest.mark.parametrize("towards", [0.0, 70.0, 180.0, -90.0])
def test_a_tilted_camera_is_on_that_side_of_the_level_picture(world, towards):
    middle, a, b = np.array([320.0, 240.0]), np.radians(80.0), np.radians(towards)
    assert world.start(middle, 0.5, 1.2)
    level = world.truth().T_world_camera
    assert world.start(middle, 0.5, 1.2, a, b)
    moved = (level.inverse() @ world.truth().T_world_camera).translation / 1.2
    np.testing.assert_allclose(
        moved, [np.sin(a) * np.cos(b), np.sin(a) * np.sin(b), 1 - np.cos(a)], atol=1e-9
    )


def test_a_start_may_be_the_targets_pose(world):
    wanted = Pose(exp_so3(np.array([1.065709, 0.054328, 0.632142])), np.array([0.15, -0.1, 1.3]))
    assert world.start_facing(wanted)
    assert np.abs(log_se3(seen(world).inverse() @ wanted)).max() < 1e-9
    assert world.start_facing(Pose(np.eye(3), np.array([0.0, 0.0, 1.0])))
    truth = world.truth()
    np.testing.assert_allclose(truth.corners[0], [320 - 60, 240 - 30], atol=1e-6)
    assert truth.theta == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("start", "sentence"),
    [
        (
            ["start.pose=[0.0, 0.0, 1.0, 180.0, 0.0, 0.0]"],
            "still: start: the camera would be 0.96 m below the table's top: place it higher",
        ),
        (
            ["start.pose=[0.0, 0.0, 0.05, 0.0, 80.0, 0.0]", "motion.x=0.0"],
            "still: start: part of the target would be behind the camera: place the camera farther "
            "away, or tilt it less",
        ),
    ],
)
def test_a_start_that_sees_nothing_is_one_sentence(start, sentence):
    plain = ["robot.kind=free", "start.x=0", "start.y=0", "start.angle_deg=0", "start.scale=1"]
    with pytest.raises(Mistake) as found:
        Episode(load("still", plain + start), Dark)
    assert str(found.value) == sentence


def test_the_back_of_a_target_is_not_seen():
    target = Pose(exp_so3(np.array([1.2, 0.0, 0.0])), np.array([0.0, 0.0, 2.0]))
    outline = 0.1 * np.array([[-1.0, 1, 0], [1, 1, 0], [1, -1, 0], [-1, -1, 0]])
    check_sight(outline, target @ Pose(DOWN, np.array([0.0, 0.0, 1.0])), target)
    with pytest.raises(
        ValueError,
        match=r"^the camera would be on the back of the target: place it on the front side$",
    ):
        check_sight(outline, target @ Pose(np.eye(3), np.array([0.0, 0.0, -1.0])), target)


@pytest.mark.parametrize(("speed", "outcome"), [(0.2, "CONVERGED"), (0.8, "DIVERGED")])
def test_a_camera_that_dives_through_the_target_has_not_converged(speed, outcome, monkeypatch):
    dive = Command(np.array([0.0, 0.0, speed, 0.0, 0.0, 0.0]))
    monkeypatch.setattr(hold.Hold, "command", lambda *_: dive)
    scenario = load(
        "line",
        [
            "robot.kind=free",
            "motion.kind=still",
            "tracker.kind=frozen",
            "controller.kind=hold",
            "run.duration=2.0",
        ],
    )
    with Episode(scenario, Dark) as episode:
        steps = list(episode)
    assert summarise(steps, scenario.measure, 30.0).outcome.name == outcome
    assert steps[-1].truth.depth == pytest.approx(1.042 - speed * (2.0 - 2 / 30), abs=1e-3)


def test_a_pose_leaves_the_terms_of_the_picture_out():
    with pytest.raises(Mistake) as found:
        load("still", ["start.x=3", "start.pose=[0.0, 0.0, 1.0, 0.0, 0.0, 0.0]"])
    assert str(found.value) == (
        "--set start.pose=[0.0, 0.0, 1.0, 0.0, 0.0, 0.0]: start: pose sets the whole start pose: "
        "leave out x, y, angle_deg, scale, tilt_deg and tilt_towards_deg (start={pose=[...]} replaces "
        "them all), or pose"
    )
