"""Goals that are seen from the side, the picture at the goal, and features that compare pictures."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from measured import measured_run

import servo
from servo import Mistake
from servo.controllers._plain_law import since
from servo.features import homography
from servo.loop.episode import Episode
from servo.scenario.load import load
from servo.sight.picture_match import alignment, matrix_of
from servo.sight.plane_motion import PlaneMotion
from servo.testing._examples import DOWN, OUTLINE, seen_from
from servo.types import CameraImage, Plane
from sim.camera.distortion import Distortion
from sim.files.picture_name import picture_named
from sim.geometry import angle_of, exp_so3
from sim.placement import object_pose
from sim.types import Camera, Pose

TILTED = (
    "robot.kind=free",
    "target.kind=tag",
    "goal.tilt_deg=40",
    "goal.tilt_towards_deg=70",
    "goal.x=20",
    "goal.angle_deg=30",
)
CAMERA = Camera(300.0, 290.0, 165.0, 118.0, 320, 240)


def ends(name, *changes):
    """Distance [mm] and angle [deg] from the goal at the end of a run."""
    scenario = load(name, [*changes, "expect={}"])
    measures = measured_run(scenario)[1].measures
    return measures["end_position_mm"], measures["end_rotation_deg"]


def test_a_tilted_goal_has_the_pose_of_its_truth():
    with Episode(load("still", [*TILTED, "tracker.kind=truth", "tracker.corners=true"])) as episode:
        outline = episode.world.outline
        there = object_pose(
            episode.goal.truth(0.0, episode.world.moment().truth.T_world_camera), outline
        )
        pose = episode.goal.sight_at(0.0).pose
        np.testing.assert_allclose(pose.translation, there.translation, atol=1e-9)
        np.testing.assert_allclose(pose.rotation, there.rotation, atol=1e-9)
        assert np.degrees(np.arccos(pose.rotation[2, 2])) == pytest.approx(40.0, abs=3.0)
        np.testing.assert_allclose(
            episode.world.camera.project(pose.translation), episode.goal.pixel, atol=1e-9
        )


@pytest.mark.parametrize(
    "wrong",
    [(), pytest.param(("believed.fx_factor=1.1", "believed.goal=shown"), marks=pytest.mark.wide)],
)
def test_a_camera_arrives_at_a_tilted_goal_with_wrong_intrinsics_too(wrong):
    corners = ("tracker.kind=truth", "tracker.corners=true", "features.kind=pose")
    known = (*TILTED, *corners, "estimator.kind=none", "run.duration=6", "controller.gain=2")
    assert max(ends("still", *known, *wrong, "camera.rate=15")) < 0.05


def test_a_tilted_goal_needs_corners():
    with pytest.raises(Mistake) as refused:
        list(servo.run(load("still", [*TILTED, "tracker.kind=truth", "run.duration=0.2"])))
    assert str(refused.value) == (
        "goal.tilt_deg: this tracker reports a rectangle, which does not show a tilt: use a "
        "tracker that reports corners, or leave goal.tilt_deg out"
    )


def pictures(*changes):
    """The picture at the goal and the first one, of a small camera that starts at the goal."""
    there = ("start={}", "start.tilt_deg=15", "start.tilt_towards_deg=30")
    small = ("camera.width=80", "camera.height=60", "camera.renderer=exact", "camera.noise=0")
    with Episode(load("goal_picture", [*there, *small, *changes, "expect={}"])) as episode:
        return episode.goal_picture.astype(float), episode.shown[0].image.astype(float)


def test_the_picture_at_the_goal_is_that_of_the_run_without_its_own_settings():
    goal, first = pictures("at_goal={}")
    assert np.abs(goal - first).max() <= 1.0


@pytest.mark.wide
def test_what_has_changed_since_is_in_one_of_both_pictures():
    plain = pictures("at_goal={}")
    bright = pictures("at_goal={}", "at_goal.camera_brightness=1.0")
    np.testing.assert_array_equal(bright[1], plain[1])
    assert bright[0].mean() / plain[0].mean() == pytest.approx(2.0, abs=0.05)
    for change in (
        "camera_noise=9.0",
        "light_strength=0.1",
        "light_elevation_deg=20",
        "clutter_number=0",
        "clutter_moved=true",
    ):
        other = pictures("at_goal={}", f"at_goal.{change}")
        np.testing.assert_array_equal(other[1], plain[1])
        assert np.abs(other[0] - plain[0]).mean() > 1.0, change


def test_standing_clutter_covers_a_plate_and_flat_clutter_does_not():
    def covered(*changes):
        free = pictures("at_goal={}", *changes, "clutter.number=0")[1]
        return float(np.mean(np.abs(pictures("at_goal={}", *changes)[1] - free).max(axis=2) > 3))

    many = ("clutter.number=60", "clutter.within=0.2")
    assert covered(*many) > 0.4
    assert covered(*many, "clutter.height=0") < 0.01


def random_motion(rng):
    normal = np.array([*rng.uniform(-0.6, 0.6, 2), 1.0])
    normal /= np.linalg.norm(normal)
    return exp_so3(rng.uniform(-0.5, 0.5, 3)), rng.uniform(-0.3, 0.3, 3), normal


def test_the_motion_of_a_plane_is_found_from_homographies_of_one_normal():
    rng = np.random.default_rng(4)
    for _ in range(20):
        normal = random_motion(rng)[2]
        motion = PlaneMotion()
        for _ in range(8):
            R, t, _ = random_motion(rng)
            found = motion.of(rng.uniform(0.5, 2) * (R + np.outer(t, normal)))
        np.testing.assert_allclose(found[0], R, atol=1e-6)
        np.testing.assert_allclose(found[1], t, atol=1e-6)
        np.testing.assert_allclose(found[2], normal, atol=1e-6)


def test_a_small_motion_is_found_with_the_normal_of_before():
    rng = np.random.default_rng(5)
    normal = random_motion(rng)[2]
    motion = PlaneMotion()
    for _ in range(8):
        motion.of(random_motion(rng)[0] + np.outer(random_motion(rng)[1], normal))
    turn, shift = np.array([1e-3, -2e-3, 3e-3]), np.array([2e-3, 1e-3, -1e-3])
    found = motion.of(exp_so3(turn) + np.outer(shift, normal))
    np.testing.assert_allclose(found[0], exp_so3(turn), atol=2e-5)
    np.testing.assert_allclose(found[1], shift, atol=2e-5)


@pytest.mark.parametrize(
    ("method", "turn", "most"),
    [("orb", 40.0, 1.0), ("sift", 150.0, 0.5), ("affine_sift", 150.0, 0.5), ("ecc", 3.0, 1.0)],
)
def test_pictures_are_aligned(method, turn, most):
    wide = picture_named("coffee", "targets", "picture")
    goal = cv2.resize(wide, (320, 240), interpolation=cv2.INTER_AREA)
    K = np.array([[300.0, 0, 165.0], [0, 290.0, 118.0], [0, 0, 1]])
    R = exp_so3(np.radians([3.0, -4.0, turn]))
    H = R + np.outer([0.02, -0.03, 0.05], [0.0, 0.0, 1.0])
    half = np.array([[1, 0, 0.5], [0, 1, 0.5], [0, 0, 1.0]])  # OpenCV counts from a pixel's middle
    pixels = np.linalg.inv(half) @ K @ H @ np.linalg.inv(K) @ half
    seen = cv2.warpPerspective(goal, pixels, (320, 240), flags=cv2.INTER_AREA)
    aligned = alignment(method, CameraImage(goal, CAMERA))
    found = aligned.find(seen)
    if method in ("affine_sift", "ecc"):
        found = aligned.find(seen)  # from where the picture before was
    at = np.array([[[x, y]] for x in (-0.2, 0.0, 0.2) for y in (-0.15, 0.15)])
    miss = cv2.perspectiveTransform(at, found) - cv2.perspectiveTransform(at, H)
    assert np.linalg.norm(miss, axis=2).max() * 300 < most


@pytest.mark.parametrize("method", ["sift", "ecc"])
def test_pictures_of_a_lens_are_aligned_as_those_of_a_pinhole(method):
    wide = cv2.resize(picture_named("coffee", "targets", "picture"), (640, 480), None, 0, 0, 3)
    lens = replace(CAMERA, distortion=Distortion("plumb_bob", (-0.3, 0.1, 0.0, 0.0, 0.0)))
    H = exp_so3(np.radians([2.0, -3.0, 2.0])) + np.outer([0.02, -0.03, 0.05], [0.0, 0.0, 1.0])
    u, v = np.meshgrid(np.arange(320) + 0.5, np.arange(240) + 0.5)
    rays = lens.normalise(np.stack([u, v], axis=-1)).reshape(1, -1, 2)

    def seen(back):
        """The picture through the lens of a plane that the homography `back` maps to the first."""
        x, y = np.moveaxis(cv2.perspectiveTransform(rays, back).reshape(240, 320, 2), 2, 0)
        at = np.float32(x * 420 + 319.5), np.float32(y * 420 + 239.5)
        return cv2.remap(wide, *at, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT)

    found = alignment(method, CameraImage(seen(np.eye(3)), lens)).find(seen(np.linalg.inv(H)))
    at = np.array([[[x, y]] for x in (-0.3, 0.0, 0.3) for y in (-0.2, 0.2)])
    miss = cv2.perspectiveTransform(at, found) - cv2.perspectiveTransform(at, H)
    assert np.linalg.norm(miss, axis=2).max() * 300 < 0.5


@pytest.mark.parametrize("turn", [0.0, 90.0])
def test_affine_sift_finds_a_goal_seen_from_the_side_where_it_is(turn):
    """The first picture is matched with compressed views of the goal, whose points have no bias."""
    goal = cv2.resize(picture_named("coffee", "targets", "picture"), (320, 240), None, 0, 0, 3)
    middle = np.array([159.5, 119.5])
    R = exp_so3(np.radians([0.0, 0.0, turn]))[:2, :2]
    turned = cv2.warpAffine(goal, np.column_stack([R, middle - R @ middle]), (320, 240))
    smooth = cv2.GaussianBlur(turned, (0, 0), 1.4, sigmaY=0.01)
    squeeze = np.array([[0.5, 0.0, 0.5 * middle[0]], [0.0, 1.0, 0.0]])
    seen = cv2.warpAffine(smooth, squeeze, (320, 240))
    K = matrix_of(CAMERA)
    found = K @ alignment("affine_sift", CameraImage(goal, CAMERA)).find(seen) @ np.linalg.inv(K)
    at = np.array([[[x, y]] for x in (80.0, 160.0, 240.0) for y in (60.0, 180.0)])
    true = (at - middle) @ R.T * [0.5, 1.0] + middle
    assert np.abs((cv2.perspectiveTransform(at, found) - true).mean(axis=(0, 1))).max() < 0.15


@pytest.mark.parametrize("method", ["orb", "sift", "affine_sift", "ecc"])
def test_pictures_without_anything_in_common_are_not_aligned(method):
    rng = np.random.default_rng(1)
    goal = np.full((120, 160, 3), 90, np.uint8)
    noise = rng.integers(0, 255, (120, 160, 3), np.uint8)
    camera = replace(CAMERA, width=160, height=120)
    for first, second in ((goal, noise), (noise, goal), (goal, goal)):
        assert method == "ecc" or alignment(method, CameraImage(first, camera)).find(second) is None
    assert alignment(method, CameraImage(noise, camera)).find(noise[::-1].copy()) is None


@pytest.mark.wide
def test_a_scenario_arrives_by_matched_points():
    assert ends("goal_picture", "camera.renderer=exact", "camera.rate=8")[0] < 10.0


def test_blurred_pictures_arrive_from_farther_away():
    away = ("start={}", "start.x=10", "start.angle_deg=5", "start.tilt_deg=12", "camera.rate=10")
    near = ("run.duration=4", "camera.width=160", "camera.height=120", "controller.gain=2")
    sharp = ends("photometric", *away, *near)
    blurred = ends("photometric", *away, *near, "features.blur=4")
    assert blurred[0] < 3.0
    assert sharp[0] > 10.0


def test_a_policy_of_four_arguments_gets_the_camera_and_a_posture_since_the_start():
    given = []

    def act(picture, goal_picture, camera, posture):
        given.append((camera, posture))
        return np.array([0.1, 0, 0, 0, 0, 0.2])

    def deep(picture, goal_picture, camera, posture, depth):
        given.append(depth)
        return np.zeros(6)

    changes = ["run.duration=0.2", "run.latency=0", "estimator.kind=none", "tracker.kind=frozen"]
    steps = list(servo.run(load("line", [*changes, "believed.fx_factor=1.2"], controller=act)))
    assert given[0][0].fx == pytest.approx(1.2 * steps[0].scene.camera.fx)
    assert np.array_equal(given[0][1].joints, np.zeros(6))
    assert np.array_equal(given[0][1].T_base_camera.translation, np.zeros(3))
    moved = since(steps[0].posture, steps[-1].posture)
    np.testing.assert_allclose(
        given[-1][1].T_base_camera.translation, moved.T_base_camera.translation
    )
    assert moved.T_base_camera.translation[0] > 0.005
    given.clear()
    list(servo.run(load("line", [*changes, "goal.depth=0.8"], controller=deep)))
    assert given[0] == pytest.approx(0.8, abs=1e-6)


@pytest.mark.parametrize("scale", [-3.0, 0.2, 1.0])
@pytest.mark.parametrize("size", [0.0199, 0.0201])
def test_a_homography_of_any_scale_is_linearised_if_it_is_near_the_identity(scale, size):
    """Exactly linear is what the linearised one is: a shift along the axis of a level plane."""
    normal = np.array([0.0, 0.6, 0.8])
    motion = PlaneMotion()
    for shift in ([0.2, 0.1, 0.1], [-0.1, 0.2, 0.1], [0.1, 0.1, -0.2]):
        motion.of(exp_so3(np.array([0.1, 0.2, 0.1])) + np.outer(shift, normal))
    H = np.eye(3) + np.outer([0.0, 0.0, size], [0.0, 0.0, 1.0])
    R, t, n = motion.of(scale * H)
    if size < 0.02:
        np.testing.assert_allclose(n, normal, atol=1e-6)  # that of before
    else:
        np.testing.assert_allclose(n, [0, 0, 1], atol=1e-6)
        np.testing.assert_allclose(t, [0, 0, size], atol=1e-6)
        np.testing.assert_allclose(R, np.eye(3), atol=1e-6)


@pytest.mark.parametrize("shift", [0.0, 5e-4])
@pytest.mark.parametrize("axis", range(3))
def test_a_pure_rotation_is_a_motion(axis, shift):
    """OpenCV gives no plane for one, nor for one with a very small translation."""
    turn = exp_so3(0.6 * np.eye(3)[axis])
    t = shift * np.array([0.6, 0.0, 0.8])
    R, found, _ = PlaneMotion().of(turn + np.outer(t, [0.0, 0.0, 1.0]))
    np.testing.assert_allclose(R, turn, atol=1e-5)
    np.testing.assert_allclose(found, t, atol=1e-5)


def test_a_plane_behind_a_camera_has_no_motion():
    flip = np.diag([1.0, -1.0, -1.0])
    assert PlaneMotion().of(flip) is None
    assert PlaneMotion().of(flip + np.outer([0.1, 0.0, 0.1], [0.0, 0.0, 1.0])) is None


def test_opencvs_pixels_begin_in_the_middle_of_the_first_one():
    np.testing.assert_array_equal(matrix_of(CAMERA), [[300, 0, 164.5], [0, 290, 117.5], [0, 0, 1]])
    np.testing.assert_array_equal(
        matrix_of(CAMERA, size=0.5), [[150, 0, 82], [0, 145, 58.5], [0, 0, 1]]
    )


@pytest.mark.parametrize(("turns", "degrees"), [(True, 90.0), (False, 0.0)])
def test_the_camera_at_its_goal_turns_with_the_target_if_the_features_do(turns, degrees):
    with Episode(load("spin"), seen=False) as episode:
        before, after = (
            episode.world.eye_at_goal(time, episode.goal.sight_at(time).pose, turns=turns)
            for time in (0.0, 2.0)
        )
    turned = np.degrees(angle_of(before.rotation.T @ after.rotation))
    assert turned == pytest.approx(degrees, abs=0.1)


def test_an_example_picture_shows_its_pattern_of_waves():
    """At four places (x, y) of the plane [m], by the formula."""
    picture = seen_from(DOWN, Pose(np.eye(3), np.zeros(3)), pixels=True).picture
    for x, y, grey in ((0, 0, 178), (0.05, 0, 234), (0, 0.05, 169), (-0.1, 0.1, 27)):
        u, v = picture.camera.to_pixels(np.array([x, y])).astype(int)
        assert abs(int(picture.image[v, u, 0]) - grey) < 8


def test_the_features_of_two_pictures_are_the_cameras_pose_at_the_goal():
    """The camera has gone 4 mm to the right and 10 mm nearer, and has turned by 1.5 degrees."""
    features = homography.Config(method="ecc").build(OUTLINE)
    moved = Pose(exp_so3(np.array([0.0, 0.0, np.radians(1.5)])), np.array([0.004, 0.0, 0.01]))
    still = Pose(np.eye(3), np.zeros(3))
    sight = seen_from(DOWN @ moved, still, pixels=True)
    np.testing.assert_allclose(
        features.values(sight), [0.004, 0, 0.01, 0, 0, np.radians(1.5)], atol=1e-3
    )
    assert features.known(sight).all()
    L = features.matrix(sight)
    np.testing.assert_allclose(L[:3, :3], moved.rotation, atol=1e-3)
    np.testing.assert_allclose(L[3:, 3:] @ [0, 0, 1], [0, 0, 1], atol=1e-3)
    assert not L[:3, 3:].any()
    assert not L[3:, :3].any()
    near = replace(sight, goal=replace(sight.goal, plane=Plane(0.0, 0.0, 2.0)))
    found = homography.Config(method="ecc").build(OUTLINE).values(near)
    np.testing.assert_allclose(found[:3], [0.002, 0, 0.005], atol=5e-4)
    there = seen_from(DOWN, still, pixels=True)
    np.testing.assert_array_equal(features.values(replace(there, picture=there.goal.picture)), 0)
    plain = CameraImage(np.full((240, 320, 3), 90, np.uint8), there.picture.camera)
    lost = replace(there, picture=plain)
    np.testing.assert_array_equal(features.values(lost), 0)
    np.testing.assert_array_equal(features.matrix(lost), np.eye(6))
    assert not features.known(lost).any()
    assert features.known(replace(there, picture=None)).all()
