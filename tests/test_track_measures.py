from dataclasses import replace

import numpy as np
import pytest

from tracking.evaluation.track import Shot, Track
from tracking.evaluation.track_file import TrackFile, read
from tracking.evaluation.track_measures import (
    MEASURES,
    Comparison,
    frames_until_loss,
    measure_all,
)
from tracking.sequences.sources import Picture
from tracking.types import Estimate, Region, State, Status, unknown_covariance

REGION = Region(40.0, 20.0)


def track(states, confidence=None):
    states = np.array(states, dtype=float)
    n = len(states)
    return Track(
        states,
        np.stack([REGION.corners(State(*row)) for row in states]),
        np.ones(n) if confidence is None else np.array(confidence),
        np.arange(n, dtype=float),
        np.full(n, 5.0),
    )


def straight(n=10, **changes):
    states = np.tile([100.0, 50.0, 0.0, 1.0], (n, 1))
    for name, value in changes.items():
        states[:, ["x", "y", "theta", "scale"].index(name)] += value
    return states


def compared(found, true, confidence=None):
    exact = track(true)
    return Comparison.of(track(found, confidence), exact.corners, exact.states)


def test_a_perfect_track_has_perfect_measures():
    found = measure_all(compared(straight(), straight()))
    # A success curve counts overlaps above each threshold, so at 1.0 even a perfect one has none.
    assert found["auc"] == found["auc_turned"] == pytest.approx(20 / 21)
    assert found["precision_20"] == found["completed"] == found["held"] == 1.0
    assert found["rmse_px"] == found["angle_rmse_deg"] == found["scale_rmse"] == 0.0
    assert (found["milliseconds"], found["evaluations"]) == (5.0, 5.0)


@pytest.mark.parametrize(("right", "held"), [(12.0, 1.0), (15.0, 0.0)])
def test_a_target_is_held_by_half_the_overlap(right, held):
    """12 px to the right leave 28 / 52 of the rectangle of 40 px, and 15 px 25 / 55."""
    assert measure_all(compared(straight(x=right), straight()))["held"] == held


def test_pictures_that_cannot_be_read_cost_no_time():
    """They are not shown to the tracker: with more than half of them the median was 0."""
    exact = track(straight())
    read = np.arange(10) < 4
    times = np.where(read, np.arange(10.0), 0.0)
    found = replace(exact, milliseconds=times, evaluations=np.where(read, 5.0, 0.0))
    measures = measure_all(Comparison.of(found, exact.corners, exact.states))
    assert (measures["milliseconds"], measures["evaluations"]) == (2.0, 5.0)


def test_errors_are_those_of_the_centre():
    found = measure_all(compared(straight(x=3.0, y=-4.0), straight()))
    assert found["mean_error_px"] == found["rmse_px"] == pytest.approx(5.0)
    half = straight()
    half[5:, 0] += 10
    found = measure_all(compared(half, straight()))
    assert found["mean_error_px"] == pytest.approx(5.0)
    assert found["rmse_px"] == pytest.approx(np.sqrt(50))


def test_overlap_counts_the_box_or_the_turned_rectangle():
    c = compared(straight(x=20.0), straight())
    np.testing.assert_allclose(c.overlaps, 1 / 3)
    np.testing.assert_allclose(c.turned_overlaps, 1 / 3, rtol=1e-6)
    assert measure_all(c)["auc"] == pytest.approx(7 / 21)  # thresholds 0, 0.05, ..., 0.3
    quarter = compared(straight(theta=np.pi / 2), straight())
    np.testing.assert_allclose(quarter.turned_overlaps, 400 / 1200, rtol=1e-6)


def test_a_late_estimate_is_compared_with_the_frame_in_which_it_arrives():
    """A target 40 px wide goes 10 px a frame: boxes one frame apart share 3 of 5 parts, boxes three
    frames apart 1 of 7; in the first frames the region that was given is all there is.
    """
    moving = straight(41)
    moving[:, 0] += 10.0 * np.arange(41)
    found = measure_all(compared(moving, moving))
    assert found["auc"] == pytest.approx(20 / 21)
    # Thresholds below .6: 12 of 21 (0 to .55); the first frame overlaps entirely.
    assert found["auc_late_1"] == pytest.approx((20 + 40 * 12) / 41 / 21, abs=1 / 21)
    first = (20 + 12 + 7) / 21  # none, one and two frames late
    assert found["auc_late_3"] == pytest.approx((first + 38 * 3 / 21) / 41)


def test_a_slow_tracker_leaves_out_the_pictures_that_come_while_it_is_busy():
    """At 30 Hz and 70 ms it sees pictures 0, 1, 3 and 5; what it knows of 0 to 7 is 0 to 4 old."""
    moving = straight(8)
    moving[:, 0] += 10.0 * np.arange(8)
    exact = track(moving)
    late = {}
    for milliseconds in (5.0, 70.0):
        found = replace(exact, milliseconds=np.full(8, milliseconds))
        late[milliseconds] = measure_all(Comparison.of(found, exact.corners))
    assert late[5.0]["auc_streamed"] == late[5.0]["auc_late_1"]
    by_age = [20, 12, 7, 3, 0]  # thresholds of 21 below the overlap
    ages = [0, 1, 2, 3, 3, 4, 3, 4]
    expected = np.mean([by_age[age] for age in ages]) / 21
    assert late[70.0]["auc_streamed"] == pytest.approx(expected)


def test_the_expected_overlap_is_zero_from_a_loss_on():
    states = straight(8)
    states[3:, 0] += 200.0
    found = measure_all(compared(states, straight(8)))
    by_length = [1, 1, 1, 3 / 4, 3 / 5, 3 / 6, 3 / 7, 3 / 8]
    assert found["expected_overlap"] == pytest.approx(np.mean(by_length))
    # Away for less than five frames: nothing is lost, and the overlaps count as they are.
    states[6:, 0] -= 200.0
    found = measure_all(compared(states, straight(8)))
    by_length = [1, 1, 1, 3 / 4, 3 / 5, 3 / 6, 4 / 7, 5 / 8]
    assert found["expected_overlap"] == pytest.approx(np.mean(by_length))


def test_angle_and_scale_errors():
    found = measure_all(compared(straight(theta=0.1 + 2 * np.pi, scale=0.2), straight()))
    assert found["angle_rmse_deg"] == pytest.approx(np.degrees(0.1))
    assert found["scale_rmse"] == pytest.approx(0.2)


def test_angle_and_scale_in_frames_without_the_target_do_not_count():
    exact = track(straight())
    exact.corners[4:6] = np.nan
    states = straight(theta=0.1, scale=0.2)
    states[4:6, 2:] += 1.0
    found = measure_all(Comparison.of(track(states), exact.corners, exact.states))
    assert found["angle_rmse_deg"] == pytest.approx(np.degrees(0.1))
    assert found["scale_rmse"] == pytest.approx(0.2)


def test_a_loss_is_five_frames_away_in_a_row():
    states = straight(20)
    states[3:7, 0] += 50  # four frames: no loss
    states[11:16, 0] += 50
    assert frames_until_loss(compared(states, straight(20))) == 11
    states[15, 0] -= 50
    c = compared(states, straight(20))
    assert frames_until_loss(c) == 20
    assert measure_all(c)["completed"] == 1.0


def test_frames_without_the_target_count_only_for_the_lost_signal():
    true = track(straight()).corners
    true[6:] = np.nan
    confidence = [0.9, 0.8, 0.9, 0.8, 0.2, 0.9, 0.1, 0.3, 0.1, 0.1]
    c = Comparison.of(track(straight(), confidence), true)
    assert len(c.errors) == 6
    # One of 4 * 6 pairs is in the wrong order: absent with 0.3, present with 0.2.
    assert measure_all(c)["lost_auc"] == pytest.approx(23 / 24)
    assert np.isnan(measure_all(c)["angle_rmse_deg"])


def test_every_measure_says_what_it_is():
    assert len({m.name for m in MEASURES}) == len(MEASURES)
    assert all(m.meaning and m.better.value in ("higher", "lower") for m in MEASURES)


def test_a_tracker_that_reports_corners_is_measured_by_them(tmp_path):
    """The state is a rectangle of 40 x 20 px; the corners, those of the truth, are half of it."""
    state, half = State(100.0, 50.0), np.array([[80.0, 40], [120, 40], [120, 60], [80, 40.001]])
    plain = Estimate(state, unknown_covariance(), 0.1, Status.LOCKED)
    cornered = Estimate(state, unknown_covariance(), 0.1, Status.LOCKED, corners=half)
    shots = [
        Shot(Picture(str(k), k / 30, None), k, estimate, 0.0, (200, 100))
        for k, estimate in enumerate([plain, cornered])
    ]
    truth = np.stack([half, half])
    comparison = Comparison.of(Track.of(shots, REGION), truth)
    np.testing.assert_allclose(comparison.turned_overlaps, [0.5, 1.0], atol=1e-3)
    file = TrackFile(tmp_path / "track.csv", REGION)
    for shot in shots:
        file.add(shot)
    file.close()
    np.testing.assert_allclose(read(tmp_path / "track.csv").corners[1], half, atol=1e-5)
