"""Sizes that camera and target cannot have reached are not servoed, and a line says so."""

import dataclasses
import math

import numpy as np
import pytest

from servo.loop.columns import Columns
from servo.loop.episode import Episode
from servo.loop.events import Event, events, remarks_on_tracker
from servo.scenario.load import load
from servo.sight.size_gate import SizeGate
from tracking import wrap
from tracking.exported import OpenCVTracker
from tracking.types import Estimate, State, Status

STEP = 1 / 30


def estimate(scale, sigma=math.nan, status=Status.LOCKED, follows=True, corners=None):
    covariance = np.full((4, 4), np.nan)
    covariance[3, 3] = sigma**2
    state = State(0.0, 0.0, 0.0, scale)
    return Estimate(state, covariance, 0.0, status, (True, follows), corners=corners)


def refused(gate, scales, ego=0.0, **more):
    found = [gate.judged(estimate(scale, **more), ego, STEP).likely_scale for scale in scales]
    return [None if each is None else round(each, 6) for each in found]


def test_a_size_that_jumps_is_refused_and_the_cameras_motion_predicts_it():
    gate = SizeGate(1.0)
    assert refused(gate, [1.0, 1.05, 1.1]) == [None] * 3
    for k in range(1, 4):
        (likely,) = refused(gate, [0.5], ego=0.02)
        assert likely == pytest.approx(math.exp(0.35 * 2 * STEP + 0.02 * k), rel=1e-5)


def test_the_cameras_own_approach_is_no_jump():
    gate = SizeGate(1.0)
    assert refused(gate, np.exp(0.1 * np.arange(1, 30)), ego=0.1) == [None] * 29


def test_a_target_that_rises_by_a_third_of_its_distance_a_second_is_followed():
    rising = np.exp(0.34 * STEP * np.arange(1, 150))
    assert refused(SizeGate(1.0), rising) == [None] * 149


def test_a_stated_deviation_widens_the_gate():
    assert refused(SizeGate(1.0), [1.2]) == [1.0]
    assert refused(SizeGate(1.0), [1.2], sigma=0.07) == [None]


def test_unseen_time_widens_the_gate_and_a_size_that_is_not_followed_is_not_judged():
    gate = SizeGate(1.0)
    assert refused(gate, [9.0] * 30, status=Status.LOST) == [None] * 30
    assert refused(gate, [1.45]) == [None]
    gate = SizeGate(1.0)
    assert refused(gate, [9.0] * 30, follows=False) == [None] * 30


def test_the_size_of_corners_is_not_judged():
    assert refused(SizeGate(1.0), [9.0] * 30, corners=np.zeros((4, 2))) == [None] * 30


def test_a_size_that_fits_again_for_a_second_counts_again():
    gate = SizeGate(1.0)
    found = refused(gate, [0.5, *[1.1] * 31])
    assert found[:30] == [1.0] * 30
    assert found[31:] == [None]


class Collapsing:
    """The right centre, and a box that shrinks by 8 % in each picture, as CSRT's does."""

    def init(self, image, rect):
        self.right = OpenCVTracker("mk_ssd")
        self.right.init(image, rect)
        self.sides = np.array(rect[2:], float)

    def update(self, image):
        seen, rect = self.right.update(image)
        self.sides = np.maximum(self.sides * 0.92, 8.0)
        corner = np.array(rect[:2]) + np.array(rect[2:]) / 2 - self.sides / 2
        return seen, (*corner, *self.sides)


@pytest.fixture(scope="module")
def collapsed():
    scenario = load("still", ["run.duration=3"])
    with Episode(dataclasses.replace(scenario, tracker=wrap(Collapsing)())) as episode:
        return [step.light() for step in episode]


def test_a_collapsing_size_does_not_lower_the_camera(collapsed):
    heights = [step.truth.T_world_camera.translation[2] for step in collapsed]
    assert abs(heights[-1] - heights[0]) < 0.05
    assert collapsed[-1].servo_error < 15


def test_the_run_says_so(collapsed):
    run = Columns.of(collapsed)
    count = int(run["size_refused"].sum())
    assert count > 60
    assert remarks_on_tracker(run) == (
        f"In {count} of 90 pictures to the end, the tracker's size had changed more than camera and "
        "target can have moved: it was not servoed"
    )
    pairs = zip([None, *collapsed], collapsed)  # noqa: B905
    assert sum(Event.SIZE_REFUSED in events(*pair) for pair in pairs) == 1
    assert collapsed[-1].servoed == (False, False)


class Still:
    def init(self, image, rect):
        self.rect = rect

    def update(self, image):
        return True, self.rect


def test_the_depth_comes_from_the_size_that_the_cameras_motion_predicts():
    scenario = load("still", ["run.duration=1"])
    with Episode(dataclasses.replace(scenario, tracker=wrap(Collapsing)())) as episode:
        last = [step.light() for step in episode][-1]
        seen = episode.sight
    assert last.estimate.state.scale < 0.3
    assert last.estimate.likely_scale == pytest.approx(last.true_state_estimated.scale, rel=0.15)
    true = last.truth_estimated
    distance = (true.T_world_camera.inverse() @ true.T_world_target).translation[2]
    assert seen.pose.translation[2] == pytest.approx(distance, rel=0.15)
    assert not seen.size_known


def test_the_time_of_dropped_pictures_counts(monkeypatch):
    intervals = []
    judged = SizeGate.judged

    def noted(gate, estimate, ego, interval):
        intervals.append(interval)
        return judged(gate, estimate, ego, interval)

    monkeypatch.setattr(SizeGate, "judged", noted)
    with Episode(load("dropped_frames", ["run.duration=4"])) as episode:
        frames = [step.frame for step in episode]
    assert len(intervals) < len(frames) - 1  # some were dropped
    last = max(frame.time for frame in frames if frame.fresh)
    assert sum(intervals) == pytest.approx(last)


@pytest.mark.parametrize(("frames", "says"), [(9, False), (15, True)])
def test_a_run_says_that_boxes_of_one_size_control_no_distance(frames, says):
    scenario = load("still", [f"run.duration={frames / 30}"])
    with Episode(dataclasses.replace(scenario, tracker=wrap(Still)())) as episode:
        run = Columns.of(episode)
    assert remarks_on_tracker(run) == ""
    if not says:
        assert remarks_on_tracker(run, is_guest=True) == ""
        return
    assert remarks_on_tracker(run, is_guest=True) == (
        "The tracker's boxes had one size in all of 15 pictures: the size was not servoed, and the "
        "camera's distance not controlled by it"
    )
