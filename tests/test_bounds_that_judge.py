"""Bounds that every run misses, or none: found in the shipped scenarios, and said in others."""

import numpy as np
import pytest

from servo.cli import main
from servo.scenario.catalogue import shipped
from servo.scenario.load import load
from servo.study.bounds import doubtful_bounds, doubts_of, missed_bounds, missed_lines


@pytest.mark.parametrize("name", shipped())
def test_every_shipped_bound_can_be_kept_and_missed(name):
    assert doubts_of(load(name)) == []


SETTINGS = ("run.duration=12", "measure.after=2", "robot.kind=arm")
ROUNDING = "rounding errors exceed this bound; raise it above 1e-09"
PERCENT = "no run misses this bound, because the measure is at most 100 %"
ANGLE = "no run misses this bound, because no angle is above 180 deg"


@pytest.mark.parametrize(
    ("name", "bound", "why"),
    [
        ("retreat_m", 0.0, ROUNDING),
        ("drawn.servo_rms_px", 0.0, ROUNDING),
        ("lost_pct", -1.0, "all runs miss this bound, because no measure is below 0"),
        ("lost_pct", 100.0, PERCENT),
        ("retreat_m", 1e-15, ROUNDING),
        (
            "joint_range_peak_pct",
            100.0,
            PERCENT,
        ),
        ("servo_angle_peak_deg", 180.0, ANGLE),
        ("tilt_peak_deg", 200.0, ANGLE),
        ("end_rotation_deg", 180.0, ANGLE),
        ("longest_off_s", 10.0, "no run misses this bound, because only 10 s of the run count"),
        ("settle_s", 11.98, "a run of 12 s misses this bound only if it never settles"),
        ("settle_s", 16.0, "a run of 12 s misses this bound only if it never settles"),
    ],
)
def test_a_bound_that_judges_nothing_is_said(name, bound, why):
    assert doubtful_bounds({name: bound}, load("still", SETTINGS)) == [
        f"expect.{name} = {bound:g}: {why}"
    ]


@pytest.mark.parametrize(
    ("name", "bound"),
    [
        ("outcome", "CONVERGED"),
        ("lost_pct", 0.0),
        ("longest_off_s", 0.0),
        ("longest_off_s", 9.9),
        ("lost_pct", 1e-12),
        ("joint_range_peak_pct", 99.0),
        ("servo_angle_peak_deg", 179.0),
        ("settle_s", 11.9),
        ("retreat_m", 0.005),
        ("servo_scale_peak_pct", 150.0),
        ("drawn.success_rate", 0.0),
    ],
)
def test_others_are_not_doubted(name, bound):
    assert doubtful_bounds({name: bound}, load("still", SETTINGS)) == []


@pytest.mark.parametrize("name", ["joint_range_peak_pct", "joint_way_pct"])
def test_a_free_camera_misses_no_bound_on_joints(name):
    free = load("still", ["robot.kind=free"])
    why = "no run misses this bound, because the free camera has no joints with limits"
    assert doubtful_bounds({name: 50.0}, free) == [f"expect.{name} = 50: {why}"]


def test_no_bound_on_a_time_that_does_not_count_is_called_kept():
    late = load("still", ["run.duration=1", "measure.after=1"])
    assert doubtful_bounds({"longest_off_s": 0.5}, late) == []


def test_the_bounds_of_other_trackers_are_looked_at(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(
        "[expect.tracker.kams]\nlost_pct = 100\n[expect.tracker.'*'.drawn]\nage_ms = -1\n"
    )
    assert doubts_of(load(str(path))) == [
        "expect.tracker.kams.lost_pct = 100: no run misses this bound, because the measure is at most 100 %",
        "expect.tracker.*.drawn.age_ms = -1: all runs miss this bound, because no measure is below 0",
    ]


def test_a_check_says_it(tmp_path, capsys, monkeypatch):
    scenario = tmp_path / "mine.toml"
    text = "run.duration = 0.1\ntracker.kind = 'truth'\n[expect]\nretreat_m = 0.0\nlost_pct = 100\n"
    scenario.write_text(text)
    monkeypatch.setattr("sys.argv", ["servobench", "check", str(scenario), "--workers", "1"])
    with pytest.raises(SystemExit):
        main.main()
    said = " ".join(capsys.readouterr().err.split())
    assert (
        "mine: expect.retreat_m = 0: rounding errors exceed this bound; raise it above 1e-09"
        in said
    )
    assert "mine: expect.lost_pct = 100: no run misses this bound" in said


def test_a_study_says_it_of_its_own_bounds(tmp_path, capsys, monkeypatch):
    study = tmp_path / "mine.toml"
    study.write_text(
        "scenario = 'still'\n[axes]\n'run.duration' = [0.1, 0.2]\n"
        "[expect]\nretreat_m = 0.0\nsettle_s = 0.15\nservo_rms_px = 1\n"
    )
    monkeypatch.setattr("sys.argv", ["servobench", "sweep", str(study), "--dry-run"])
    with pytest.raises(SystemExit):
        main.main()
    said = " ".join(capsys.readouterr().out.split())
    assert said.count("expect.retreat_m = 0: rounding errors exceed this bound") == 1
    assert (
        "expect.settle_s = 0.15: a run of 0.1 s misses this bound only if it never settles" in said
    )
    assert "servo_rms_px = 1" not in said


def test_a_run_that_is_too_short_has_a_line_of_its_own_for_when_it_settles():
    measures = {"servo_rms_px": np.nan, "settle_s": np.inf}
    missed = missed_bounds("TIMED_OUT", measures, {"servo_rms_px": 1.0, "settle_s": 1.0})
    assert missed_lines(missed, measures) == [
        "settle_s is not finite, expected at most 1",
        "servo_rms_px: no value, because the run ended before measure.after",
    ]
