"""A policy: a controller that is given pictures."""

import re
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

import servo
from servo import Mistake
from servo.loop.episode import Episode
from servo.loop.run_measures import Outcome, summarise
from servo.testing import check_controller
from tracking.types import Status

SHORT = ["run.duration=0.4", "run.latency=0", "estimator.kind=none"]


def towards(picture, goal_picture, posture, *, gain=0.01):
    """Moves by the colours' difference, and by the joints."""
    apart = picture.mean(axis=(0, 1)) - goal_picture.mean(axis=(0, 1))
    return np.concatenate([gain * apart, np.full(3, 0.01 * posture.joints.sum())])


class Policy:
    """The same as a class, which remembers what it was given."""

    def __init__(self, gain=0.01):
        self.gain = gain
        self.given = []
        self.resets = 0

    def reset(self):
        self.resets += 1

    def act(self, picture, goal_picture, posture):
        self.given.append((picture, goal_picture, posture.joints))
        return towards(picture, goal_picture, posture, gain=self.gain)


def twists(*changes, **given):
    return [
        step.command.twist for step in servo.run(servo.load("line", [*SHORT, *changes], **given))
    ]


def test_a_function_a_class_and_an_object_are_the_same_policy():
    each = [
        twists(controller=towards, gain=0.02),
        twists(controller=Policy, gain=0.02),
        twists(controller=Policy(0.02)),
    ]
    assert np.ptp(each[0], axis=0).max() > 1e-3
    np.testing.assert_array_equal(each[0], each[1])
    np.testing.assert_array_equal(each[0], each[2])


def test_it_is_given_each_picture_and_the_goals_and_the_joints():
    policy = Policy()
    with Episode(
        servo.load("line", [*SHORT, "tracker.kind=truth"], controller=policy), seen=False
    ) as episode:
        steps = list(episode)
        goal = episode.goal_picture
    assert len(policy.given) == len(steps) == 12
    assert goal.any()
    assert policy.resets == 1
    for step, (picture, goal_picture, joints) in zip(steps, policy.given, strict=True):
        np.testing.assert_array_equal(picture, step.frame.image)
        np.testing.assert_array_equal(goal_picture, goal)
        np.testing.assert_array_equal(joints, step.posture.joints)


def test_it_acts_whatever_the_tracker_sees_but_stands_still_without_a_picture():
    blind = twists("tracker.kind=truth", "tracker.dropouts=1", controller=towards)
    assert np.array_equal(blind, twists("tracker.kind=frozen", controller=towards))
    dropped = "disturbances=[{ kind = 'dropped_frames', share = 0.5 }]"
    steps = list(
        servo.run(servo.load("line", [*SHORT, dropped, "run.duration=1"], controller=towards))
    )
    moves = [step.command.twist.any() for step in steps]
    assert moves == [step.frame.fresh for step in steps]
    assert 0 < sum(moves) < len(moves)


def test_a_run_that_ends_at_the_goal_has_converged_though_its_tracker_is_lost():
    at_goal = ["run.duration=0.4", "start.x=0", "start.y=0", "start.angle_deg=0", "start.scale=1"]
    steps = list(servo.run(servo.load("still", at_goal, controller=lambda a, b, c: np.zeros(6))))
    lost = [replace(s, estimate=replace(s.estimate, status=Status.LOST)) for s in steps]
    measured = servo.load("still").measure
    assert summarise(lost, measured, 1 / 30).outcome is Outcome.CONVERGED
    steps = list(servo.run(servo.load("still", at_goal)))
    lost = [replace(s, estimate=replace(s.estimate, status=Status.LOST)) for s in steps]
    assert summarise(lost, measured, 1 / 30).outcome is Outcome.TARGET_LOST


def test_its_time_counts_as_a_trackers():
    def slow(picture, goal_picture, posture):
        time.sleep(0.05)
        return np.zeros(6)

    measured = ["run.tracker_ms=measured", "tracker.kind=frozen", "run.duration=0.5"]
    steps = list(servo.run(servo.load("line", [*SHORT, *measured], controller=slow)))
    assert all(step.age >= 0.05 for step in steps if step.picture > 0)
    # Of 15 pictures at 30 Hz each is worked on for two intervals, or many more on a busy machine.
    assert steps[-1].skipped >= 1
    given = twists("run.tracker_ms=100", "tracker.kind=frozen", controller=towards)
    changes = np.flatnonzero(np.any(np.diff(given, axis=0), axis=1)) + 1
    assert changes.tolist() == [4, 7, 10]


def test_policies_are_checked_as_laws():
    check_controller(Policy)
    check_controller(towards)

    class Remembers(Policy):
        def act(self, picture, goal_picture, posture):
            self.gain += 1.0
            return super().act(picture, goal_picture, posture)

    with pytest.raises(AssertionError, match="start"):
        check_controller(Remembers)


@pytest.mark.parametrize(
    ("policy", "sentence"),
    [
        (
            lambda a, b, c: np.zeros(3),
            "Command.twist is [0. 0. 0.]; it should be a NumPy array of six finite numbers",
        ),
        (
            lambda a, b, c: np.full(6, np.nan),
            "Command.twist is [nan nan nan nan nan nan]; it should be",
        ),
        (lambda a, b, c: a.nothing, "AttributeError: 'numpy.ndarray' object has no attribute"),
    ],
)
def test_what_is_no_policy_is_one_sentence(policy, sentence):
    with pytest.raises(Mistake) as found:
        servo.simulate("still", ["run.duration=0.1"], controller=policy)
    assert sentence in str(found.value)
    assert "\n" not in str(found.value)


def test_it_needs_a_picture_of_the_goal_that_stands():
    scenario = servo.load("still", SHORT, controller=towards)
    with Episode(scenario) as episode:
        loop = servo.Loop(scenario, episode.world.camera, episode.world.outline)
        with pytest.raises(ValueError, match="there is no picture of the goal: give it to Loop"):
            loop.start(*episode.shown)
    with pytest.raises(Mistake, match="so the goal must not move"):
        servo.simulate("still", ["goal.depth_to=0.8"], controller=towards)


def test_the_policy_of_the_manual_moves_the_camera_after_the_picture():
    """Where all is 6 px to the right of where it should be, at 0.6 m, the camera goes 12 mm."""
    page = (Path(__file__).parents[1] / "scenes" / "benchmarks" / "README.md").read_text()
    names: dict[str, Any] = {}
    exec(re.findall(r"^```python\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)[0], names)
    camera = servo.Camera(fx=300.0, fy=300.0, cx=160.0, cy=120.0, width=320, height=240)
    noise = np.random.default_rng(0).integers(0, 256, (280, 360, 3), dtype=np.uint8)
    ground = cv2.normalize(cv2.GaussianBlur(noise, None, 3.0), None, 0, 255, cv2.NORM_MINMAX)
    goal, picture = ground[20:260, 20:340], ground[20:260, 14:334]
    act = names["Policy"]().act
    np.testing.assert_allclose(
        act(picture, goal, camera, None, 0.6), [0.012, 0, 0, 0, 0, 0], atol=3e-4
    )
    np.testing.assert_array_equal(act(0 * picture, goal, camera, None, 0.6), np.zeros(6))
