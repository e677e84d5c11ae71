"""Every feature set through every lens: its matrix against differences of its own values."""

from dataclasses import replace

import numpy as np
import pytest
from servoing import OUTLINE, posture_of

from servo.scenario.catalogue import PLUGINS
from servo.scenario.load import load
from servo.sight.estimate_to_sight import EstimateToSight, SightConfig
from servo.sight.exact import corners_in, sight_of
from servo.types import CameraImage
from sim.camera.distortion import Distortion
from sim.geometry import exp_se3, exp_so3
from sim.types import Camera, Pose
from tracking.types import Estimate, Region, State, Status, unknown_covariance

LENSES = {
    "none": (300.0, None),
    "plumb_bob": (260.0, Distortion("plumb_bob", (-0.35, 0.12, 0.002, -0.003, 0.0))),
    "rational": (260.0, Distortion("rational", (0.5, 0.1, 0.001, -0.002, 0.01, 0.8, 0.2, 0.05))),
    "fisheye": (180.0, Distortion("fisheye", (-0.02, 0.005, -0.003, 0.0005))),
}
CAMERAS = {
    f"{name}, {shape} pixels": Camera(fx, ratio * fx, 157.0, 124.0, 320, 240, lens)
    for name, (fx, lens) in LENSES.items()
    for shape, ratio in (("square", 1.0), ("oblong", 0.7))
}
BY_PICTURES = ("photometric", "homography")
SETS = {kind: [] for kind in PLUGINS["features"][0].names() if kind not in BY_PICTURES} | {
    "moments, paper": ["features.scaling=paper"],
    "segment, normalised": ["features.normalised=true"],
    "pose, cMo": ["features.error=cMo"],
}
GOAL = Pose(np.eye(3), np.array([0.02, -0.01, 0.5]))
SEEN = Pose(exp_so3(np.array([0.3, -0.2, 0.4])), np.array([-0.06, 0.04, 0.6]))
REGION = Region(1.0, 1.0)  # a tracker that reports corners needs none
STEP = 1e-5
"""Of the camera's motion: central differences are then good to about 1e-9, but the pose of corners
is found by Newton's method, to 1e-10 or so."""


def seen_by(camera, T_camera_object, goal=None):
    """The sight of a tracker that reports the corners where this camera shows them."""
    eye = EstimateToSight(SightConfig(), camera, REGION, OUTLINE)
    corners = camera.project(corners_in(T_camera_object, OUTLINE))
    if goal is None:
        return eye.goal_of(corners)
    state = State(0.0, 0.0, 0.0, 1.0)
    estimate = Estimate(state, unknown_covariance(), 0.0, Status.LOCKED, corners=corners)
    sight = eye.see(estimate, posture_of(np.zeros(6)), goal)
    assert sight is not None
    return sight


def by_differences(values, at, step):
    """Derivatives (k, 6) of values by the camera's motion, which moves the target by its inverse."""
    columns = []
    for unit in np.eye(6):
        ahead, behind = (values(exp_se3(sign * step * unit).inverse() @ at) for sign in (1.0, -1.0))
        columns.append((ahead - behind) / (2 * step))
    return np.stack(columns, axis=1)


def built(name):
    """A feature set, with its settings after a comma."""
    kind = name.split(",")[0]
    return load("still", [f"features.kind={kind}", *SETS.get(name, [])]).features.build(OUTLINE)


@pytest.mark.parametrize("name", SETS)
@pytest.mark.parametrize("lens", CAMERAS)
def test_a_matrix_is_the_derivative_of_what_is_seen_through_the_lens(name, lens):
    camera = CAMERAS[lens]
    features = built(name)
    goal = seen_by(camera, GOAL)
    L = features.matrix(seen_by(camera, SEEN, goal))
    found = by_differences(lambda pose: features.values(seen_by(camera, pose, goal)), SEEN, STEP)
    np.testing.assert_allclose(L, found, rtol=0, atol=1e-4)


@pytest.mark.parametrize("lens", CAMERAS)
def test_the_pixels_explain_the_cameras_motion_through_the_lens(lens):
    """The pictures are of a wavy plane that faces the camera, at the depth that is believed."""
    camera = CAMERAS[lens]
    v, u = np.indices((camera.height, camera.width)) + 0.5
    rays = np.concatenate([camera.normalise(np.stack([u, v], axis=-1)), np.ones((*u.shape, 1))], 2)
    outline = np.append(OUTLINE[:, :2], np.zeros((4, 1)), axis=1)
    facing = Pose(np.eye(3), np.array([0.0, 0.0, 0.5]))

    def sight(pose, goal=None):
        """The exact one, with the picture of the plane, whose brightness is a function of X, Y."""
        points = rays * (pose.rotation[:, 2] @ pose.translation) / (rays @ pose.rotation[:, 2:])
        X, Y, _ = np.moveaxis((points - pose.translation) @ pose.rotation, -1, 0)
        grey = 128 + 50 * np.sin(21 * X + 4 * Y) + 50 * np.cos(17 * Y - 6 * X)
        image = np.rint(grey).astype(np.uint8)[..., None].repeat(3, axis=2)
        return replace(sight_of(pose, outline, goal), picture=CameraImage(image, camera))

    features = built("photometric")
    goal = sight(facing)
    found = by_differences(lambda pose: features.values(sight(pose, goal)), facing, 5e-3)
    # The filter's derivatives, and whole grey values. For a pinhole it would be 1 to 2 off.
    np.testing.assert_allclose(features.matrix(goal), found, atol=0.06)


@pytest.mark.parametrize("lens", CAMERAS)
def test_corners_weigh_by_their_pixels_through_the_lens(lens):
    """40 px from the border of a picture 320 px wide, of which 0.3 count: 0.05 / 0.25."""
    camera = CAMERAS[lens]
    pixels = np.array([[40.0, 120.0], [160.0, 120.0], [300.0, 120.0], [160.0, 210.0]])
    h = np.ones(14)
    h[:8] = [0.05 / 0.25, 0.0, 0.0, 0.0, 0.175 / 0.125, 0.0, 0.0, 0.05 / 0.25]
    features = built("weighted")
    L = features.matrix(seen_by(camera, SEEN, seen_by(camera, GOAL)))
    values = np.append(camera.normalise(pixels).ravel(), np.zeros(6))
    expected = np.linalg.pinv(h[:, None] * L) * h
    np.testing.assert_allclose(features.inverse(L, values, camera), expected, atol=1e-6)
