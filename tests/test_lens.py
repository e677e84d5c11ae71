"""A loop that sees through a distorting lens, the pictures behind it, and renderers of others."""

from dataclasses import dataclass, replace

import cv2
import numpy as np
import pytest
from measured import measured_run
from servoing import OUTLINE

from servo.loop.episode import Episode
from servo.scenario.load import load
from servo.sight import shape_moments
from servo.sight.estimate_to_sight import EstimateToSight, SightConfig
from sim import placement
from sim.camera.camera import CameraConfig
from sim.camera.distortion import Distortion
from sim.camera.lens import Lens, Sensor
from sim.geometry import exp_se3
from sim.types import Camera, Pose, Posture
from tracking.types import Estimate, Region, State, Status, unknown_covariance

BARREL = Distortion("plumb_bob", (-0.35, 0.12, 0.002, -0.003, 0.0))
FISHEYE = Distortion("fisheye", (-0.02, 0.005, -0.003, 0.0005))
LENSES = {"plumb_bob": (260.0, BARREL), "fisheye": (180.0, FISHEYE)}
CAMERA = Camera(260.0, 260.0, 160.0, 120.0, 320, 240, BARREL)
PLAIN = Camera(260.0, 260.0, 160.0, 120.0, 320, 240)


def changes_for(name):
    focal, lens = LENSES[name]
    return [
        f"camera.fx={focal}",
        f"camera.distortion={lens.model}",
        f"camera.coefficients={list(lens.coefficients)}",
    ]


class Painter:
    """A renderer of another kind: white where the pixel's ray goes right, and no car at all."""

    closed = 0

    def __init__(self, model, name, view):
        assert model.camera(name).id >= 0
        self.view = view
        u, v = np.meshgrid(np.arange(view.width) + 0.5, np.arange(view.height) + 0.5)
        right = view.normalise(np.stack([u, v], axis=-1))[..., 0] > 0.2
        self.picture = np.where(right[..., None], 255, 0).astype(np.uint8).repeat(3, axis=2)

    def begin(self, _data):
        return lambda: self.picture

    def silhouette(self, _data, geoms, *, alone):
        assert geoms.any()
        return np.full((self.view.height, self.view.width), alone)

    def close(self):
        Painter.closed += 1


@dataclass(frozen=True)
class Perfect:
    """A tracker that knows the truth of the worlds in the list."""

    worlds: list

    def build(self, rng):
        return self

    def start(self, frame, region, state):
        pass

    def update(self, _frame, _ego=None):
        truth = self.worlds[0].truth()
        state = State(*truth.centre.tolist(), truth.theta, truth.size / self.worlds[1])
        return Estimate(state, unknown_covariance(), 0.0, Status.LOCKED)


@pytest.mark.parametrize("lens", LENSES)
@pytest.mark.parametrize("goal", [(0, 0), (70, -40), (-90, 60)])
def test_with_a_perfect_tracker_the_goal_is_reached(lens, goal):
    more = [f"goal.x={goal[0]}", f"goal.y={goal[1]}", "run.duration=9.0", "start.x=20"]
    worlds = []
    scenario = replace(load("still", [*changes_for(lens), *more]), tracker=Perfect(worlds))
    with Episode(scenario, renderer=Painter) as episode:
        worlds += [episode.world, episode.world.truth().size]
        end = [step.light() for step in episode][-1]
    assert end.servo_error < 0.15
    assert abs(np.degrees(end.truth.theta - end.goal.theta)) < 0.05
    assert end.truth.size == pytest.approx(end.goal.size, rel=1e-3)
    above = end.truth.T_world_camera.inverse() @ end.truth.T_world_target
    assert above.apply(end.scene.outline.mean(axis=0))[2] == pytest.approx(1.0, rel=2e-3)


@pytest.mark.parametrize(
    ("camera", "features", "goal"),
    [
        (["camera.fx=290", "camera.fy=275"], "points", "computed"),
        (["camera.fx=290", "camera.fy=275"], "segment", "pose"),
        (changes_for("plumb_bob"), "points", "shown"),
        (changes_for("fisheye"), "points", "computed"),
    ],
)
def test_corners_end_where_the_camera_sees_them_at_the_goal(camera, features, goal):
    """A rectangle of the target's shape, as other trackers report it, is not what it sees there."""
    changes = ["target.kind=plate", "robot.kind=free", "run.latency=0", "run.duration=5.0"]
    changes += ["tracker.kind=truth", "tracker.corners=true", f"features.kind={features}"]
    changes += [f"believed.goal={goal}", "goal.x=40", "goal.y=-25", "goal.angle_deg=30"]
    _, summary = measured_run(load("still", [*changes, *camera]))
    assert summary.measures["end_position_mm"] < 0.1
    assert summary.measures["end_rotation_deg"] < 0.01


@pytest.mark.parametrize("lens", LENSES)
def test_a_drive_is_followed_through_a_lens(lens):
    changes = ["run.duration=4.0", "measure.after=2.0", *changes_for(lens)]
    report = measured_run(load("circle", changes))[1]
    assert report.measures["servo_rms_px"] < 2.0
    assert report.measures["tracking_rms_px"] < 1.5


@pytest.mark.parametrize("theta", [0.0, 0.7, -2.0])
def test_the_start_has_the_angle_and_the_size_that_the_goal_asks_for(theta):
    pixel = np.array([250.0, 60.0])
    eye = placement.camera_above(CAMERA, OUTLINE.mean(axis=0), 0.3, pixel, theta, 0.9)
    seen = placement.truth(CAMERA, OUTLINE, eye, Pose.planar(0.0, 0.0, 0.3))
    np.testing.assert_allclose(seen.centre, pixel, atol=1e-6)
    assert seen.theta == pytest.approx(theta, abs=0.02)
    size = placement.truth_above(CAMERA, OUTLINE, pixel, theta, 0.9).size
    assert seen.size == pytest.approx(size, rel=1e-9)
    assert size < 0.95 * PLAIN.focal / 0.9  # a barrel shows less at the border


def test_the_moments_of_a_state_are_those_of_the_straightened_rectangle():
    region, state = Region(60.0, 30.0), State(250.0, 60.0, 0.4, 1.1)
    corners = CAMERA.normalise(region.corners(state))
    m = shape_moments.of_state(state, region, CAMERA)
    a, b, c, d = corners
    assert m.area == pytest.approx(abs(np.linalg.det([c - a, d - b])) / 2)
    assert m.area > 1.1 * shape_moments.of_state(state, region, PLAIN).area
    found = cv2.moments((1000 * corners).astype(np.float32))
    middle = np.array([found["m10"], found["m01"]]) / found["m00"] / 1000
    np.testing.assert_allclose([m.xg, m.yg], middle, atol=1e-5)


@pytest.mark.parametrize("twist", [[0.3, 0, 0, 0, 0, 0], [0.1, 0.1, 0.1, 0, 0, 0.8]])
def test_ego_is_where_the_camera_has_moved_a_target_that_stood(twist):
    nothing, dt = np.zeros(0), 0.1
    eye = Pose(np.diag([1.0, -1.0, -1.0]), np.array([-0.25, 0.1, 1.0]))
    target = Pose.planar(0.03, -0.02, 0.4)
    before = placement.truth(CAMERA, OUTLINE, eye, target)
    seeing = EstimateToSight(
        SightConfig(), CAMERA, Region(0.2 * before.size, 0.1 * before.size), OUTLINE
    )
    state = State(*before.centre.tolist(), before.theta, 1.0)
    posture = Posture(eye, np.zeros(6), nothing, nothing, nothing, np.zeros((6, 0)))
    seeing.see(Estimate(state, unknown_covariance(), 0.0, Status.LOCKED), posture)
    after = placement.truth(CAMERA, OUTLINE, eye @ exp_se3(np.array(twist) * dt), target)
    change = seeing.ego(state, np.array(twist), dt)
    np.testing.assert_allclose(change[:2], after.centre - before.centre, rtol=0.01, atol=0.05)
    assert change[2] == pytest.approx(after.theta - before.theta, abs=0.01)
    assert change[3] == pytest.approx(np.log(after.size / before.size), abs=0.02)


def test_the_view_covers_what_the_camera_sees_and_no_lens_changes_nothing():
    lens, picture = Lens(CAMERA), np.zeros((240, 320, 3), np.uint8)
    u, v = np.meshgrid(np.linspace(0, 320, 33), np.linspace(0, 240, 25))
    there = lens.view.to_pixels(CAMERA.normalise(np.stack([u, v], axis=-1)))
    size = np.array([lens.view.width, lens.view.height])
    assert there.min() > -1e-6
    assert np.all(there.max(axis=(0, 1)) < size + 1e-6)
    np.testing.assert_allclose(there.max(axis=(0, 1)), size)
    assert Lens(PLAIN).view is PLAIN
    assert Lens(PLAIN).bend(picture) is picture


def test_an_exposure_is_bent_once_as_each_of_its_pictures_would_be():
    lens, rng = Lens(CAMERA), np.random.default_rng(0)
    sensor = Sensor(CameraConfig(exposure=0.5), lens, rng)
    shape = (lens.view.height, lens.view.width, 3)
    pictures = [rng.integers(0, 256, shape, np.uint8) for _ in range(4)]
    each = np.mean([lens.bend(picture).astype(float) for picture in pictures], axis=0)
    np.testing.assert_allclose(sensor.develop(pictures, 1.0).astype(float), each, atol=1.6)
    np.testing.assert_array_equal(sensor.develop(pictures[:1], 1.0), lens.bend(pictures[0]))
    darker = sensor.develop(pictures[:1], 0.5).astype(float)
    np.testing.assert_allclose(darker, lens.bend(pictures[0]) / 2, atol=1.1)


def test_a_mask_is_counted_in_the_cameras_own_picture():
    lens = Lens(CAMERA)
    view = np.zeros((lens.view.height, lens.view.width), bool)
    assert lens.count(~view) == 320 * 240
    view[:, : lens.view.width // 2] = True  # left of the principal point, whatever its lens
    assert lens.count(view) == pytest.approx(320 * 240 / 2, rel=0.02)
    u, v = np.meshgrid(np.arange(lens.view.width) + 0.5, np.arange(lens.view.height) + 0.5)
    at = CAMERA.to_pixels(lens.view.normalise(np.stack([u, v], axis=-1)))
    outside = np.any((at < -1) | (at > (321, 241)), axis=-1)
    assert outside.sum() > 2000
    assert lens.count(outside) == 0


def test_a_car_in_sight_is_wholly_visible_through_a_lens():
    changes = ["world.visibility=true", "start.x=0", *changes_for("fisheye")]
    with Episode(load("still", changes)) as episode:
        assert episode.world.truth().visible == 1.0


def test_another_renderer_can_be_put_in():
    more = ["world.visibility=true", "tracker.kind=frozen", "start.x=0", *changes_for("plumb_bob")]
    Painter.closed = 0
    with Episode(load("still", more), renderer=Painter) as episode:
        step = next(iter(episode))
    edge = np.argmax(step.frame.image[..., 0] > 127, axis=1)
    v = np.arange(240) + 0.5
    y = step.scene.camera.normalise(np.stack([edge + 0.0, v], axis=-1))
    np.testing.assert_allclose(y[:, 0], 0.2, atol=1.5 / 230)  # a line, bent as the lens does
    assert np.ptp(edge) >= 2
    assert step.truth.visible == 0.0
    assert Painter.closed == 1


def test_noise_below_a_level_is_added():
    """Half a level of noise moves a third of the pixels of an even picture by one level."""
    config = CameraConfig(width=64, height=48, noise=0.5)
    grey = np.full((48, 64, 3), 100, np.uint8)
    plain = Lens(Camera(60.0, 60.0, 32.0, 24.0, 64, 48))
    seen = Sensor(config, plain, np.random.default_rng(0)).develop([grey], 1.0)
    assert abs(seen.astype(int) - 100).max() in (1, 2)
    assert (seen != 100).mean() == pytest.approx(0.317, abs=0.02)
