"""The goal of a run is a truth: a camera that is exactly there has no error."""

import numpy as np
import pytest

import servo
from servo.loop.run_measures import summarise

AT_GOAL = [
    "start.x=0",
    "start.angle_deg=0",
    "start.scale=1",
    "robot.kind=free",
    "tracker.kind=truth",
    "run.duration=1.0",
    "measure.after=0.0",
]
FISHEYE = [
    "camera.fx=180",
    "camera.distortion=fisheye",
    "camera.coefficients=[-0.02, 0.005, -0.003, 0.0005]",
]
BARREL = [
    "camera.distortion=plumb_bob",
    "camera.coefficients=[-0.28, 0.07, 0.001, -0.002, 0.0]",
]
CAMERAS = {
    "plain": [],
    "off-centre": ["camera.cx=150", "camera.cy=110"],
    "pixels not square": ["camera.fx=290", "camera.fy=200"],
    "barrel": BARREL,
    "fisheye": FISHEYE,
}
REGIONS = {
    "default": [],
    "wide": ["region.width=1.5"],
    "shifted and turned": ["region.x=9", "region.y=-5", "region.angle_deg=20"],
}
TARGETS = {
    "car": [],
    "box": ["target.kind=box"],
    "plate": ["target.kind=plate"],
    "tag": ["target.kind=tag"],
}
GOALS = {
    "middle": [],
    "aside": ["goal.x=70", "goal.y=-30", "goal.angle_deg=35", "goal.depth=0.9"],
}


@pytest.mark.parametrize("goal", GOALS)
@pytest.mark.parametrize("camera", CAMERAS)
def test_a_camera_at_its_goal_has_no_error(camera, goal):
    first = next(servo.run(servo.load("still", [*AT_GOAL, *CAMERAS[camera], *GOALS[goal]])))
    assert first.corner_errors.max() < 1e-6
    assert first.servo_error < 1e-6
    assert first.rotation_error < 1e-6
    assert np.abs(first.T_object_goal.translation - first.T_object_camera.translation).max() < 1e-9
    assert first.truth.theta == pytest.approx(first.goal.theta, abs=1e-9)
    assert first.truth.size == pytest.approx(first.goal.size, rel=1e-9)
    assert np.abs(first.error).max() < 1e-9  # the law sees the same goal


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("region", REGIONS)
def test_the_goal_is_that_of_the_target_whatever_region_the_tracker_is_given(region, target):
    scenario = servo.load("still", [*AT_GOAL, *REGIONS[region], *TARGETS[target]])
    first = next(servo.run(scenario))
    assert first.corner_errors.max() < 1e-6
    assert first.rotation_error < 1e-6


@pytest.mark.parametrize("camera", ["pixels not square", "barrel", "fisheye"])
def test_a_law_stays_at_its_goal_behind_a_lens(camera):
    scenario = servo.load("still", [*AT_GOAL, *CAMERAS[camera], *GOALS["aside"]])
    *_, last = steps = list(servo.run(scenario))
    assert max(step.corner_errors.max() for step in steps) < 1e-6
    measures = summarise(steps, scenario.measure, 1 / scenario.camera.rate).measures
    assert measures["end_position_mm"] < 1e-6
    assert measures["end_rotation_deg"] < 1e-5
    assert last.rotation_error < 1e-6


@pytest.mark.parametrize("wrong", ["believed.depth_factor=1.5", "believed.size_factor=1.2"])
def test_the_goal_is_not_what_the_robot_wrongly_believes(wrong):
    scenario = servo.load("still", [*AT_GOAL, wrong, "believed.goal=computed"])
    first = next(servo.run(scenario))
    assert first.corner_errors.max() < 1e-6
    assert np.abs(first.T_object_goal.translation - first.T_object_camera.translation).max() < 1e-9


@pytest.mark.parametrize(("features", "nearest"), [("moments", 0.0), ("points", 50.0)])
def test_half_a_turn_counts_where_the_features_tell_front_from_back(features, nearest):
    changes = [*AT_GOAL, "start.angle_deg=180", "tracker.corners=true", f"features.kind={features}"]
    first = next(servo.run(servo.load("still", changes)))
    assert nearest <= first.corner_errors.min() <= nearest + 20.0
