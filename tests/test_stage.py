"""What disturbs the scene, and the other robot, as the camera sees them."""

import numpy as np
import pytest

from servo.loop.episode import Episode
from servo.scenario.load import load
from sim.camera.camera import CameraConfig
from sim.disturbances import dropped_frames, second_target, spot
from sim.motions import line, still
from sim.robots import arm, gantry
from sim.targets import car
from sim.world import World, WorldParts

RNG = np.random.default_rng()
STILL = still.Config(heading_deg=10.0).build(RNG)


def make(motion=STILL, disturbances=(), robot=gantry):
    design, target = robot.Config().build(RNG), car.Config().build(RNG)
    rng = np.random.default_rng(1)
    return World(WorldParts(design, target, motion, disturbances), rng)


def see(world, y=120.0, theta=0.0):
    assert world.start(np.array([160.0, y]), theta, 1.0)
    return world.look(), world.truth()


def test_a_dropped_frame_is_the_last_picture_again_and_says_so():
    drops = dropped_frames.Config(share=1.0).build(np.random.default_rng(0))
    world = make(motion=line.Config(x=0.0).build(np.random.default_rng()), disturbances=[drops])
    see(world)
    for _ in range(15):  # frames are dropped from the 15th on
        first = world.look()
        assert first.fresh
        world.step(np.zeros(6))
    dropped = world.look()
    assert not dropped.fresh
    assert (dropped.index, dropped.time) == (15, 15 * world.period)
    assert dropped.image is first.image
    world.close()


def test_a_second_target_is_seen_where_it_is_and_only_then():
    twin = second_target.Config(start=0.05, x=0.25, y=0.0).build(np.random.default_rng())
    world = make(disturbances=[twin])
    before, _ = see(world)
    world.step(np.zeros(6))
    world.step(np.zeros(6))
    after = world.look()
    changed = np.abs(before.image.astype(int) - after.image).max(axis=2) > 60
    # 0.25 m away at 290 px/m, 20 x 10 cm large, turned by 90 degrees.
    rows, columns = np.nonzero(changed)
    turned = np.radians(10.0)
    expected = np.array([160 + 72 * np.cos(turned), 120 + 72 * np.sin(turned)])
    np.testing.assert_allclose([columns.mean(), rows.mean()], expected, atol=8)
    assert 800 < changed.sum() < 2200
    world.close()


@pytest.fixture(scope="module")
def ratio():
    """Brightness of a picture under a spot over that of one without (240, 320)."""
    light = spot.Config(start=0.0, ramp=0.01).build(np.random.default_rng())
    away = still.Config(x=0.0, y=0.3).build(np.random.default_rng())
    lit, plain = make(motion=away, disturbances=[light]), make(motion=away)
    pictures = []
    for world in (lit, plain):
        see(world, y=33.0)
        world.step(np.zeros(6))
        pictures.append(world.look().image.astype(float))
        world.close()
    return pictures[0].mean(axis=2) / pictures[1].mean(axis=2)


def test_a_spot_dims_the_rest(ratio):
    assert np.median(ratio[:, :20]) < 0.8


@pytest.mark.opengl  # the exact renderer lights the table by its corners, outside the cone
def test_a_spot_brightens_its_middle(ratio):
    assert np.median(ratio[110:130, 150:170]) > 1.25 * np.median(ratio[:, :20])


def test_the_arm_looks_where_the_gantry_looks():
    pictures, truths = [], []
    for robot in (gantry, arm):
        world = make(robot=robot)
        frame, truth = see(world, theta=0.3)
        pictures.append(frame.image.astype(int))
        truths.append(truth.centre)
        world.close()
    np.testing.assert_allclose(truths[0], truths[1], atol=1e-6)
    assert np.mean(np.abs(pictures[0] - pictures[1]).max(axis=2) > 8) < 0.01


@pytest.mark.parametrize("roll", [-100.0, -90.0])
def test_a_board_hides_the_target_from_a_camera_in_the_room(roll):
    pose = f"camera.pose=[0.0, -1.2, 0.6, {roll}, 0.0, 0.0]"
    board = "disturbances=[{kind='board', start=0.1, duration=0.5}]"
    changes = [pose, board, "controller.kind=hold", "tracker.kind=truth", "run.duration=0.6"]
    with Episode(load("hand_plate", [*changes, "world.visibility=true", "expect={}"])) as episode:
        seen = [step.truth.visible for step in episode]
    assert min(seen) == 0.0


def test_an_interval_that_nobody_looked_at_is_not_in_the_next_exposure():
    design, target = gantry.Config().build(RNG), car.Config().build(RNG)
    moves = line.Config(x=0.0, speed=1.0).build(RNG)
    camera = CameraConfig(exposure=0.5)

    def pictures(*looks):
        world = World(WorldParts(design, target, moves, (), camera), np.random.default_rng(1))
        assert world.start(np.array([160.0, 120.0]), 0.0, 1.0)
        for look in looks:
            world.step(np.zeros(6))
            image = world.look().image if look else None
        world.close()
        return image

    np.testing.assert_array_equal(pictures(False, True), pictures(True, True))
