import warnings

import numpy as np
import pytest

from servo.loop.episode import Episode
from servo.scenario.load import load
from sim import placement
from sim.camera.camera import CameraConfig
from sim.camera.choice import renderer_of
from sim.disturbances import board, brightness
from sim.motions import circle, line, still
from sim.mounting import CAMERA
from sim.robots import gantry
from sim.targets import car
from sim.types import Frame
from sim.world import Unstable, World, WorldConfig, WorldParts

STILL = still.Config(heading_deg=10.0).build(np.random.default_rng())


def make(camera=None, motion=STILL, disturbances=(), robot=gantry, renderer=None, **world):
    parts = WorldParts(
        robot.Config().build(np.random.default_rng()),
        car.Config().build(np.random.default_rng()),
        motion,
        disturbances,
        camera or CameraConfig(),
        config=WorldConfig(**world),
    )
    return World(parts, np.random.default_rng(1), renderer=renderer)


@pytest.fixture
def world():
    made = make(visibility=True)
    yield made
    made.close()


def see(world, x=160.0, y=120.0, theta=0.0, depth=1.0):
    assert world.start(np.array([x, y]), theta, depth)
    return world.look(), world.truth()


def car_mask(image):
    """The blue of the car, which nothing else near the image's centre has."""
    red, green, blue = (image[..., i].astype(int) for i in range(3))
    return (blue > 90) & (blue > red + 50) & (blue > green + 40)


def test_the_model_compiles_without_warnings_and_every_part_has_a_name():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        made = make()
    m = made.model
    for count, of in ((m.nbody, m.body), (m.njnt, m.joint), (m.nu, m.actuator), (m.ncam, m.camera)):
        assert all(of(i).name for i in range(count))
    made.close()


@pytest.mark.parametrize(
    ("x", "y", "theta", "depth"), [(160, 120, 0.0, 1.0), (220, 100, 0.6, 0.8), (90, 150, -2.0, 1.1)]
)
def test_start_puts_the_target_where_it_was_asked_for(world, x, y, theta, depth):
    _, truth = see(world, x, y, theta, depth)
    np.testing.assert_allclose(truth.centre, [x, y], atol=1e-6)
    assert truth.theta == pytest.approx(theta, abs=1e-9)
    assert truth.size == pytest.approx(world.camera.fx / depth, rel=1e-9)


def test_unstable_physics_names_the_fastest_twist_and_what_helps():
    made = make()
    made.data.qvel[0] = np.nan  # as if it had diverged
    twists = np.zeros((len(made.ticks), 6))
    twists[0] = 0.3, 0.0, 0.4, 0.0, 0.0, 0.0
    twists[1] = 0.1, 0.0, 0.0, 0.0, 2.0, 0.0
    with pytest.raises(Unstable) as found:
        made.step(twists)
    made.close()
    assert str(found.value) == (
        "the simulation became unstable, at commanded camera twists of up to 0.5 m/s and 2 rad/s: "
        "limit the law's twists if these are too fast, else raise world.physics_rate, which is too "
        "low for drives or masses"
    )


def test_start_says_when_the_gantry_cannot_be_there(world):
    assert not world.start(np.array([160.0, 120.0]), 0.0, 2.5)


def test_the_truth_lies_on_the_rendered_car(world):
    frame, truth = see(world, 160, 120, 0.5)
    rows, columns = np.nonzero(car_mask(frame.image))
    near = np.hypot(columns - 160, rows - 120) < 60
    middle = columns[near].mean() + 0.5, rows[near].mean() + 0.5
    # Lamps, windows and stripe are not blue: the paint's centroid is not quite the car's.
    np.testing.assert_allclose(middle, truth.centre, atol=3.0)


def test_the_silhouette_has_the_size_of_the_reference_rectangle(world):
    see(world)
    target = world.model.geom_bodyid == world.model.body("target").id
    renderer = renderer_of(CameraConfig())(world.model, CAMERA, world.camera)
    pixels = renderer.silhouette(world.data, target, alone=True).sum()
    renderer.close()
    rectangle = 0.2 * 0.1 * (world.camera.fx / 1.0) ** 2
    assert pixels == pytest.approx(rectangle, rel=0.06)  # rounded corners, wheels that stick out


def test_frames_are_read_only_and_have_the_asked_size():
    made = make(CameraConfig(width=200, height=160))
    frame, _ = see(made, 100.0, 80.0)
    assert frame.image.shape == (160, 200, 3)
    assert not frame.image.flags.writeable
    made.close()


def test_a_frame_shows_an_array_and_leaves_it_to_its_owner():
    image = np.zeros((4, 5, 3), np.uint8)
    frame = Frame(image, 0.0, 0)
    image[1, 2] = 7
    assert frame.image[1, 2].tolist() == [7, 7, 7]
    assert not frame.image.flags.writeable


def test_measured_twist_is_the_twist_that_was_asked_for(world):
    see(world)
    asked = np.array([0.1, -0.05, 0.02, 0.0, 0.0, 0.3])
    for _ in range(15):
        world.step(asked)
    # Velocity servos with friction stay 1 to 4 % below what they are asked for.
    np.testing.assert_allclose(world.posture().twist, asked, rtol=0.05, atol=2e-3)


def test_measured_twist_explains_how_the_truth_moves(world):
    _, before = see(world, 200, 120)
    world.step(np.array([0.2, 0.0, 0.0, 0.0, 0.0, 0.0]))
    for _ in range(10):
        before = world.truth()
        world.step(np.array([0.2, 0.0, 0.0, 0.0, 0.0, 0.0]))
    moved = world.truth().centre - before.centre
    vx = world.posture().twist[0]
    assert moved[0] == pytest.approx(-vx / 30 * world.camera.fx / 1.0, rel=1e-3)


def test_a_moving_target_alone_moves_the_truth_before_and_after():
    made = make(motion=line.Config(x=0.0, speed=0.3).build(np.random.default_rng()))
    see(made)
    made.step(np.zeros(6))
    before = placement.truth(
        made.camera,
        made.outline,
        made.truth().T_world_camera,
        made.target_at(made.data.time - made.period),
    )
    moved = made.truth().centre - before.centre
    np.testing.assert_allclose(moved, [0.3 / 30 * made.camera.fx, 0.0], atol=0.02)
    made.close()


def test_frame_times_are_whole_periods():
    made = make(CameraConfig(rate=5.0))
    see(made)
    for index in range(1, 4):
        made.step(np.zeros(6))
        frame = made.look()
        assert (frame.index, frame.time) == (index, index * 0.2)
    made.close()


def test_a_board_hides_the_target_completely():
    made = make(disturbances=[board.Config(start=0.1, duration=0.2).build(None)], visibility=True)
    see(made)
    seen = []
    for _ in range(20):
        made.step(np.zeros(6))
        seen.append(made.truth().visible)
    at = {round(k / 30, 3): v for k, v in enumerate(seen, 1)}
    assert all(v == 0.0 for t, v in at.items() if 0.1 <= t <= 0.3)
    assert at[0.667] == 1.0
    made.close()


def test_brightness_scales_the_image():
    dim = brightness.Config(start=0.0, ramp=0.001, factor=0.5, duration=9.0).build(None)
    plain, dimmed = make(), make(disturbances=[dim])
    pictures = []
    for made in (plain, dimmed):
        see(made)
        made.step(np.zeros(6))
        pictures.append(made.look().image.astype(float))
        made.close()
    np.testing.assert_allclose(pictures[1], pictures[0] / 2, atol=0.51)


def test_noise_has_its_standard_deviation_and_differs_from_frame_to_frame():
    plain, noisy = make(), make(CameraConfig(noise=5.0))
    clean, first, second = see(plain)[0].image, see(noisy)[0].image, noisy.look().image
    inner = (clean > 30) & (clean < 225)  # where clipping does not bite
    difference = (first.astype(float) - clean)[inner]
    assert difference.std() == pytest.approx(5.0, rel=0.03)
    assert np.mean(first != second) > 0.8
    plain.close()
    noisy.close()


def test_exposure_blurs_what_moves_and_nothing_else():
    drive = line.Config(x=0.0, speed=0.4).build(np.random.default_rng())
    sharp, blurred = (make(CameraConfig(exposure=e), drive) for e in (0.0, 1.0))
    images = []
    for made in (sharp, blurred):
        see(made)
        made.step(np.zeros(6))
        images.append(made.look().image.astype(int))
        made.close()
    changed = np.abs(images[0] - images[1]).max(axis=2) > 8
    rows, columns = np.nonzero(changed)
    assert changed.sum() > 60
    assert columns.min() > 120
    assert columns.max() < 205
    assert rows.min() > 95


def test_the_same_world_twice_gives_the_same_pixels():
    drive = circle.Config().build(np.random.default_rng())
    images = []
    for _ in range(2):
        made = make(CameraConfig(noise=2.0), drive)
        see(made)
        for _ in range(3):
            made.step(np.array([0.1, 0.0, 0.0, 0.0, 0.0, 0.2]))
        images.append(made.look().image)
        made.close()
    np.testing.assert_array_equal(images[0], images[1])


def test_a_blur_holds_the_targets_own_motion():
    """Sub-frames show the car where it was then: the blur is as long as its drive."""
    drive = line.Config(x=0.0, speed=1.2).build(np.random.default_rng())
    made = make(CameraConfig(exposure=1.0), drive)
    see(made)
    made.step(np.zeros(6))
    sharp = make(CameraConfig(), drive)
    see(sharp)
    sharp.step(np.zeros(6))
    # Its nose goes from 189 px to 200.6 px: it covers what lies between for part of the time.
    red = [world.look().image[112:128, :, 0].astype(float).mean(axis=0) for world in (made, sharp)]
    wood, car = red[1][206:212].mean(), red[1][193:197].mean()
    covered = (wood - red[0][193:197].mean()) / (wood - car)
    assert 0.3 < covered < 0.8
    made.close()
    sharp.close()


def test_a_supersampled_picture_is_the_mean_of_a_larger_one():
    """Its size, truth and visible share are those of the plain one."""
    fine = Episode(load("still", ["camera.supersample=2", "world.visibility=true", "start.x=0"]))
    large = Episode(load("still", ["camera.width=640", "camera.height=480", "start.x=0"]))
    plain = Episode(load("still", ["world.visibility=true", "start.x=0"]))
    with fine, large, plain:
        looks = [episode.look() for episode in (fine, large, plain)]
    pictures = [look.frame.image.astype(float) for look in looks]
    assert pictures[0].shape == pictures[2].shape == (240, 320, 3)
    mean = pictures[1].reshape(240, 2, 320, 2, 3).mean(axis=(1, 3))
    assert np.abs(pictures[0] - mean).max() <= 0.75  # rounding of a mean of four
    assert np.abs(pictures[2] - mean).max() > 20
    np.testing.assert_array_equal(looks[0].truth.corners, looks[2].truth.corners)
    assert looks[0].truth.visible == looks[2].truth.visible == 1.0
