"""Scenarios meet their bounds, and repeat exactly."""

import itertools

import numpy as np
import pyarrow.parquet as pq
import pytest

from servo.loop.episode import Episode, run
from servo.loop.events import events
from servo.loop.run_measures import summarise
from servo.loop.settings import stream
from servo.output.run_folder import RunFolder
from servo.output.steps_table import TIMED
from servo.scenario.load import load
from servo.study.bounds import missed_bounds


def report_of(scenario):
    return summarise(list(run(scenario)), scenario.measure, 1 / scenario.camera.rate)


def tilts(steps, report):
    assert report.measures["tilt_peak_deg"] > 20.0  # SERVO: 23 to 28 degrees for a drive of 1 m


def levels(steps, report):
    assert report.measures["tilt_peak_deg"] < 2.0


def searches_and_finds(steps, report):
    told = [event.name for a, b in itertools.pairwise([None, *steps]) for event in events(a, b)]
    assert told == [
        "OCCLUDED",
        "COASTING",
        "LOST",
        "HOLDING",
        "SEARCHING",
        "FOUND",
    ]


MORE = {"six_dof": tilts, "six_dof_levelled": levels, "found_again": searches_and_finds}
"""What else is true of the run of a scenario."""


JUDGED = (*MORE, "occlusion")
"""With another seed; `servobench check` judges all scenarios, with the seed of their file."""


@pytest.mark.parametrize("name", JUDGED)
@pytest.mark.newest
@pytest.mark.wide
def test_bounds_are_kept(name):
    scenario = load(name, seed=3)  # not the seed that anybody looks at first
    steps = list(run(scenario))
    report = summarise(steps, scenario.measure, 1 / scenario.camera.rate)
    assert [
        str(v) for v in missed_bounds(report.outcome.name, report.measures, scenario.expect)
    ] == []
    if name in MORE:
        MORE[name](steps, report)


@pytest.mark.wide
def test_without_an_estimate_of_the_motion_the_lag_is_what_theory_says():
    lagging = report_of(load("line", ["estimator.kind=none", "run.duration=4.0"]))
    fed = report_of(load("line", ["run.duration=4.0"]))
    lag = 290 * 0.1 / (1.0 * 2.0)  # f v / (Z lambda)
    assert lagging.measures["servo_rms_px"] == pytest.approx(lag, rel=0.05)
    assert fed.measures["servo_rms_px"] < lagging.measures["servo_rms_px"] / 5


def test_the_frozen_tracker_fails_where_the_real_one_does_not():
    scenario = load("line", ["tracker.kind=frozen", "run.duration=6.0"])
    report = report_of(scenario)
    of_own = scenario.bounds.of(scenario.bounds.own)
    missed = {v.name for v in missed_bounds(report.outcome.name, report.measures, of_own)}
    assert {"outcome", "servo_rms_px", "tracking_rms_px"} <= missed
    others = {v.name for v in missed_bounds(report.outcome.name, report.measures, scenario.expect)}
    assert others == {"outcome", "servo_rms_px"} == scenario.expect.keys()


@pytest.mark.wide
def test_six_degrees_of_freedom_tilt_the_camera_while_the_error_looks_fine():
    six = ["controller.kind=ibvs", 'controller.dof=["vx", "vy", "vz", "wx", "wy", "wz"]']
    report = report_of(load("line", [*six, "run.duration=6.0"]))
    assert report.measures["tilt_peak_deg"] > 10.0
    assert report.measures["servo_rms_px"] < 4.0


@pytest.mark.wide
def test_known_planes_and_the_papers_scaling_close_the_loop_too():
    scenario = load("still", ["sight.plane=known", "features.scaling=paper"], seed=3)
    report = report_of(scenario)
    assert missed_bounds(report.outcome.name, report.measures, scenario.expect) == ()


def test_more_latency_is_a_later_command():
    with Episode(load("still", ["run.latency=3", "run.duration=0.5"])) as episode:
        steps = list(episode)
    for k, step in enumerate(steps):
        expected = steps[k - 3].command.twist if k >= 3 else np.zeros(6)
        np.testing.assert_array_equal(step.twist_acting, expected)


@pytest.mark.wide
def test_a_small_weight_on_the_turns_keeps_the_camera_almost_level():
    weights = ["controller.weights=[1.0, 1.0, 1.0, 0.1, 0.1, 1.0]", "run.duration=6.0"]
    assert report_of(load("six_dof", weights)).measures["tilt_peak_deg"] < 1.0


@pytest.mark.wide
def test_a_goal_that_moves_is_followed():
    change = ["goal.change_start=1.0", "goal.change_duration=2.0", "run.duration=5.0"]
    with Episode(load("approach", change)) as loop:
        steps = list(loop)
    sizes = {round(s.frame.time, 3): s for s in steps}
    assert sizes[1.0].goal.size == pytest.approx(loop.world.camera.fx / 1.1)
    assert sizes[2.0].goal.size == pytest.approx(loop.world.camera.fx / (1.1 - 0.35 / 2))
    end = steps[-1]
    assert end.goal.size == pytest.approx(loop.world.camera.fx / 0.75)
    assert end.truth.size == pytest.approx(end.goal.size, rel=0.02)


def test_a_tracker_told_of_the_cameras_motion_follows_better():
    """From far away the camera moves fast at first: that part of the motion need not be guessed."""
    far = ["camera.rate=10.0", "run.duration=3.0", "measure.after=0.0", "tracker.kind=mean_shift"]
    plain, told = (
        report_of(load("start_far", [*far, f"run.ego={ego}"])).measures["tracking_rms_px"]
        for ego in ("false", "true")
    )
    assert told < 0.6 * plain


def test_the_same_seed_repeats_bit_for_bit(tmp_path):
    scenario = load(
        "occlusion", ["run.duration=2.0", "disturbances.0.start=1.0", "camera.noise=3.0"]
    )
    tables = []
    for name in ("once", "again"):
        (tmp_path / name).mkdir()
        with Episode(scenario) as episode:
            folder = RunFolder(tmp_path / name, episode, rerun=False)
            for step in episode:
                folder.add(step)
            folder.close()
        table = pq.read_table(tmp_path / name / "steps.parquet")
        tables.append(table.drop_columns([c for c in table.column_names if c.startswith(TIMED)]))
    assert tables[0].num_rows == 60
    for name in tables[0].column_names:
        a, b = (t[name].to_numpy(zero_copy_only=False) for t in tables)
        np.testing.assert_array_equal(a, b, err_msg=name)


def test_another_seed_is_another_run():
    first, second = (
        next(s for s in run(load("still", ["run.duration=0.1"], seed=seed)) if s.frame.index == 2)
        for seed in (0, 1)
    )
    assert first.estimate.state != second.estimate.state


@pytest.mark.parametrize("change", ["region.x=4", "region.width=0.8", "region.angle_deg=6"])
def test_a_region_that_is_a_little_off_is_what_the_tracker_gets(change):
    exact, shifted = (
        next(iter(run(load("still", [*changes, "run.duration=0.1"])))) for changes in ([], [change])
    )
    assert shifted.estimate.state != exact.estimate.state or shifted.region != exact.region


@pytest.mark.parametrize("kind", ["mean_shift", "kams", "condensation", "mk_ssd"])
def test_other_trackers_close_the_loop_with_what_they_follow(kind):
    """The centre converges; so do angle and size if the tracker follows them, else they hold."""
    changes = [f"tracker.kind={kind}", "run.duration=4.0", "measure.after=3.0"]
    steps = list(run(load("still", changes)))
    assert steps[-1].servo_error < 4.0
    angle, size = steps[-1].estimate.follows
    turned = np.degrees(abs(steps[-1].truth.theta - steps[-1].goal.theta))
    grown = abs(steps[-1].truth.size / steps[-1].goal.size - 1)
    assert turned < 2.0 if angle else turned == pytest.approx(20.0, abs=0.5)
    assert grown < 0.03 if size else grown == pytest.approx(0.2, abs=0.01)


def test_parts_draw_from_streams_of_their_own():
    a, b, again = (stream(4, name).random(3) for name in ("tracker", "sensor", "tracker"))
    assert not np.array_equal(a, b)
    np.testing.assert_array_equal(a, again)
    assert not np.array_equal(a, stream(5, "tracker").random(3))


@pytest.mark.wide
def test_a_square_region_is_followed_without_its_angle():
    steps = list(run(load("still", ["region.width=0.5", "run.duration=3.0", "start.angle_deg=10"])))
    assert steps[-1].servo_error < 30.0
    assert all(np.isfinite(s.command.twist).all() for s in steps)
    assert abs(steps[-1].command.twist[5]) == 0.0
