"""A camera that stands, and a robot that holds the target: against ViSP's eye-to-hand equations."""

from itertools import pairwise

import numpy as np
import pytest
from dark import Dark

from servo.loop.episode import Episode, measured_run
from servo.mistake import Mistake
from servo.scenario.load import load
from sim.geometry import log_se3

STEP = 1e-6
EXACT = (
    "tracker.kind=truth",
    "tracker.corners=true",
    "features.kind=points",
    "estimator.kind=none",
    "run.latency=0",
    "controller.gain=1.5",
    "run.duration=5.0",
)


def cross(v):
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def by_differences(robot, data, camera):
    """Return the held body's twist in the camera frame per joint rate: V eJe of ViSP."""
    q = data.qpos[robot.qpos].copy()
    robot.refresh(data)
    fixed = camera.inverse() @ robot.hand(data)
    V = np.zeros((6, 6))
    V[:3, :3] = V[3:, 3:] = fixed.rotation
    V[:3, 3:] = cross(fixed.translation) @ fixed.rotation
    hand = robot.hand(data)
    eJe = np.zeros((6, len(q)))
    for k in range(len(q)):
        data.qpos[robot.qpos] = q + STEP * np.eye(len(q))[k]
        robot.refresh(data)
        eJe[:, k] = log_se3(hand.inverse() @ robot.hand(data)) / STEP
    data.qpos[robot.qpos] = q
    robot.refresh(data)
    return V @ eJe


def rows(x, y, Z):
    """Return the interaction matrix of a point (Chaumette and Hutchinson 2006)."""
    return [
        [-1 / Z, 0, x / Z, x * y, -(1 + x * x), y],
        [0, -1 / Z, y / Z, 1 + y * y, -x * y, -x],
    ]


def test_the_closed_loop_is_that_of_visp():
    """EYETOHAND_L_cVe_eJe: q' = -gain (-L V J)+ e, in each step of a run that ends at the goal."""
    scenario = load("hand_plate", EXACT)
    with Episode(scenario, Dark) as episode:
        robot, data = episode.world.robot, episode.world.data
        goal = episode.running.goal_sight.points
        wanted = (goal[:, :2] / goal[:, 2:]).ravel()
        for _ in range(episode.frames):
            step = episode.look()
            seen = step.truth.T_world_camera.inverse() @ step.truth.T_world_target
            corners = seen.apply(step.scene.outline)
            s = corners[:, :2] / corners[:, 2:]
            L = np.concatenate([rows(*p, Z) for p, Z in zip(s, corners[:, 2], strict=True)])
            VJ = by_differences(robot, data, step.truth.T_world_camera)
            rates = -1.5 * np.linalg.pinv(-L @ VJ) @ (s.ravel() - wanted)
            ours = np.linalg.solve(-VJ, episode.move(step).command.twist)
            if step.frame.index:  # the tracker has not seen the first picture's corners
                np.testing.assert_allclose(ours, rates, atol=1e-5)
    assert np.abs(s.ravel() - wanted).max() < 1e-3
    assert len(s) == 4


def test_what_the_hand_holds_moves_with_it_and_not_by_itself():
    steps, summary = measured_run(load("hand_plate", [*EXACT, "run.duration=1.0"]))
    first, last = steps[0], steps[-1]
    assert first.truth.T_world_camera == last.truth.T_world_camera
    np.testing.assert_allclose(first.truth.T_world_camera.translation, [0.0, -0.9, 0.75])
    way = last.truth.T_world_target.translation - first.truth.T_world_target.translation
    assert np.linalg.norm(way) > 0.15
    assert not np.abs([s.target_motion_true for s in steps]).any()
    for before, now in pairwise(steps):
        moved = log_se3(before.T_object_camera.inverse() @ now.T_object_camera) * 30
        np.testing.assert_allclose(now.twist_measured, moved, atol=1e-9)
    assert 0.2 < summary.measures["camera_path_m"] < 0.5


def test_a_wrong_place_of_the_camera_bends_the_way_and_leaves_the_end_right():
    wrong = ["believed.hand_eye_rotation_deg=[0, 0, 20]", "believed.hand_eye_mm=[50, 0, 0]"]
    right, _ = measured_run(load("hand_plate", EXACT))
    bent, summary = measured_run(load("hand_plate", [*EXACT, *wrong]))
    ways = [np.array([s.T_object_camera.translation for s in steps]) for steps in (right, bent)]
    apart = np.linalg.norm(ways[0] - ways[1], axis=1)
    assert apart.max() > 0.015
    assert summary.measures["end_position_mm"] < 2.0


def test_each_start_is_found_from_everywhere():
    """Without a home, by the search; the same pose as from the home."""
    with Episode(load("hand_tag", ["robot.home=[]", "tracker.kind=truth"]), Dark) as episode:
        seen = episode.world.truth()
    np.testing.assert_allclose(seen.centre, [320 + 60, 240 + 40], atol=1e-3)


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        (
            ["goal.depth=2.5"],
            "hand_plate: start: the robot cannot bring the target where this picture is taken: ",
        ),
    ],
)
def test_what_a_held_target_cannot_do(changes, sentence):
    with pytest.raises(Mistake) as refused:
        Episode(load("hand_plate", changes), Dark)
    assert str(refused.value).startswith(sentence)


def test_a_motion_of_a_held_target_is_refused_at_once():
    with pytest.raises(Mistake) as refused:
        load("hand_tag", ["motion.kind=line"])
    assert str(refused.value) == (
        "hand_tag: motion: the robot holds the target, so nothing else moves it"
    )


def test_a_pose_is_of_a_camera_in_the_world():
    with pytest.raises(Mistake) as refused:
        load("still", ["camera.pose=[0, 0, 1, 180, 0, 0]"])
    assert str(refused.value).endswith(
        'camera: pose and held are of a camera with mounted = "world"'
    )
