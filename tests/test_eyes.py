"""What a controller knows of the target's plane, and a tracker of the camera's motion."""

import numpy as np
import pytest
from servoing import CAMERA, OUTLINE, plane_of

from servo.sight import shape_moments
from servo.sight.estimate_to_sight import EstimateToSight, SightConfig
from servo.sight.planes import PlaneFit, plane_of_size
from sim import placement
from sim.geometry import exp_se3, exp_so3
from sim.types import Pose, Posture
from tracking.types import Estimate, Region, State, Status

REGION = Region(58.0, 29.0)
TARGET = Pose.planar(0.03, -0.02, 0.4)


def posture(T_world_camera, twist=None):
    nothing = np.zeros(0)
    return Posture(
        T_world_camera,
        np.zeros(6) if twist is None else twist,
        nothing,
        nothing,
        nothing,
        np.zeros((6, 0)),
    )


def camera_at(tilt=0.0, x=0.0, y=0.0, height=1.0):
    down = np.diag([1.0, -1.0, -1.0]) @ exp_so3(np.array([tilt, 0.0, 0.0]))
    return Pose(down, np.array([x, y, height]))


def estimate_of(truth, status=Status.LOCKED):
    state = State(*truth.centre.tolist(), truth.theta, truth.size / 290.0)
    return Estimate(state, np.zeros((4, 4)), 0.0, status)


def sight(seeing, camera, target=TARGET):
    truth = placement.truth(CAMERA, OUTLINE, camera, target)
    return seeing.see(estimate_of(truth), posture(camera))


def to_sight(**config):
    factor = config.pop("depth_factor", 1.0)
    return EstimateToSight(SightConfig(**config), CAMERA, REGION, OUTLINE, factor)


def test_a_level_camera_sees_the_same_plane_by_every_way():
    for plane in ("parallel", "known", "estimated"):
        for depth in ("size", "known"):
            seen = sight(to_sight(plane=plane, depth=depth), camera_at(height=0.8))
            np.testing.assert_allclose(seen.plane.vector, [0, 0, 1 / 0.8], atol=1e-6)


def test_a_tilted_camera_knows_the_normal_or_not():
    camera = camera_at(tilt=0.3)
    true = plane_of(camera.inverse() @ TARGET, 0.0)
    known = sight(to_sight(plane="known", depth="known"), camera).plane
    np.testing.assert_allclose(known.vector, true.vector, atol=1e-12)
    # From size: the target is small, so the depth of its middle is that of all of it, nearly.
    sized = sight(to_sight(plane="known", depth="size"), camera).plane
    np.testing.assert_allclose(sized.vector, true.vector, rtol=0.02, atol=1e-3)
    facing = sight(to_sight(plane="parallel", depth="known"), camera)
    ray = np.array([facing.moments.xg, facing.moments.yg, 1.0])
    assert facing.plane.A == facing.plane.B == 0.0
    assert pytest.approx(float(true.vector @ ray), rel=1e-9) == facing.plane.C


def test_depth_from_size_is_exact_for_a_small_target_on_any_plane():
    normal, root_area = np.array([0.3, -0.2, 1.0]), 0.002
    m0 = shape_moments.of_corners(
        CAMERA.to_pixels(np.array([[0.1, 0.05]])).repeat(4, 0)
        + [[0, 0], [0.1, 0], [0.1, 0.1], [0, 0.1]],
        CAMERA,
    )
    found = plane_of_size(m0, root_area, normal).vector
    np.testing.assert_allclose(found / np.linalg.norm(found), normal / np.linalg.norm(normal))
    corners = np.array([[0.1, 0.05, 1], [0.1 + 0.1 / 290, 0.05, 1], [0.1, 0.05 + 0.1 / 290, 1]])
    points = corners / (corners @ found)[:, None]
    area = np.linalg.norm(np.cross(points[1] - points[0], points[2] - points[0]))
    assert np.sqrt(area) == pytest.approx(root_area, rel=1e-3)


def test_a_wrong_depth_is_told_wrong_by_its_factor():
    right, wrong = (sight(to_sight(depth_factor=f), camera_at()).plane for f in (1.0, 1.5))
    assert pytest.approx(1.5) == right.C / wrong.C
    goal = to_sight(depth_factor=0.7).goal(State(160.0, 120.0), REGION)
    assert pytest.approx(1 / 0.7) == goal.plane.C


def test_what_is_not_locked_is_not_seen():
    truth = placement.truth(CAMERA, OUTLINE, camera_at(), TARGET)
    for status in (Status.UNSURE, Status.LOST):
        assert to_sight().see(estimate_of(truth, status), posture(camera_at())) is None


def test_the_plane_is_found_from_where_the_target_drives():
    """A camera that begins tilted believes the plane faces it; a drive in two directions tells."""
    seeing, camera = to_sight(plane="estimated", depth="known"), camera_at(tilt=0.15)
    true = plane_of(camera.inverse() @ TARGET, 0.0).vector

    def off(target):
        found = sight(seeing, camera, target).plane.vector
        cosine = found @ true / np.linalg.norm(found) / np.linalg.norm(true)
        return np.degrees(np.arccos(min(cosine, 1.0)))

    assert off(TARGET) == pytest.approx(np.degrees(0.15), abs=0.1)
    for k in range(200):
        angle = 2 * np.pi * k / 200
        last = off(Pose.planar(0.25 * np.cos(angle), 0.2 * np.sin(angle), angle))
    assert last < 1.0


def test_without_motion_the_prior_stays():
    fit, camera = PlaneFit(), camera_at(tilt=0.1)
    for _ in range(50):
        fit.add(camera, np.array([0.0, 0.0, 1.0]))
    np.testing.assert_allclose(fit.normal(camera), [0, 0, 1], atol=1e-9)
    turned = camera_at(tilt=0.3)
    np.testing.assert_allclose(
        turned.rotation @ fit.normal(turned), camera.rotation[:, 2], atol=1e-9
    )


@pytest.mark.parametrize(
    "twist", [[0.3, 0, 0, 0, 0, 0], [0, -0.2, 0.3, 0, 0, 0], [0.1, 0.1, 0.1, 0, 0, 0.8]]
)
def test_ego_is_where_the_camera_has_moved_a_target_that_stood(twist):
    seeing, camera, dt = to_sight(), camera_at(), 0.1
    sight(seeing, camera)
    before = placement.truth(CAMERA, OUTLINE, camera, TARGET)
    after = placement.truth(CAMERA, OUTLINE, camera @ exp_se3(np.array(twist) * dt), TARGET)
    change = seeing.ego(estimate_of(before).state, np.array(twist), dt)
    np.testing.assert_allclose(change[:2], after.centre - before.centre, atol=1e-6)
    assert change[2] == pytest.approx(after.theta - before.theta, abs=1e-6)
    assert change[3] == pytest.approx(np.log(after.size / before.size), abs=1e-6)
