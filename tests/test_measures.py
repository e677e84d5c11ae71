"""Measures of a run whose every step is known."""

from dataclasses import replace

import numpy as np
import pyarrow.parquet as pq
import pytest
from measured import measured_run

from servo.cli import main
from servo.loop.episode import Episode
from servo.loop.measure import COUNTED, MEASURES
from servo.loop.run_measures import Outcome, summarise
from servo.loop.settings import MeasureConfig
from servo.report.run_section import section
from servo.scenario.load import load
from servo.study.bounds import missed_bounds
from sim.geometry import exp_so3
from sim.types import Pose
from tracking.types import Status


@pytest.fixture(scope="module")
def steps():
    with Episode(load("still", ["run.duration=4.0", "controller.kind=hold"])) as episode:
        return list(episode)


def off(step, pixels):
    truth = replace(
        step.truth,
        centre=step.goal.centre + [pixels, 0.0],
        theta=step.goal.theta,
        size=step.goal.size,
    )
    return replace(step, truth=truth)


def report(steps, **config):
    return summarise(steps, MeasureConfig(**config), 1 / 30)


def test_servo_error_counts_from_the_time_asked_for(steps):
    made = [off(s, 3.0 if s.frame.time < 2 else 1.0) for s in steps]
    assert report(made, after=2.0).measures["servo_rms_px"] == pytest.approx(1.0)
    assert report(made, after=0.0).measures["servo_peak_px"] == pytest.approx(3.0)
    assert report(made).measures["servo_rms_px"] == pytest.approx(np.sqrt(5.0))


def test_a_run_that_ends_before_errors_count_has_no_value_of_them(steps):
    """The last frame alone was counted then, as if it were the run."""
    values = report(steps, after=9.0).measures
    missing = {name for name, value in values.items() if np.isnan(value)}
    assert missing == {
        "acceleration_peak_m_s2",
        "effort_rms_deg_s",
        "effort_rms_mm_s",
        "joint_range_peak_pct",
        "longest_off_s",
        "not_held_pct",
        "servo_angle_peak_deg",
        "servo_angle_rms_deg",
        "servo_peak_px",
        "servo_rms_px",
        "servo_scale_peak_pct",
        "servo_scale_rms_pct",
        "tilt_peak_deg",
        "tracking_angle_rms_deg",
        "tracking_peak_px",
        "tracking_rms_px",
        "tracking_scale_rms_pct",
    }
    assert missing == {*COUNTED}
    assert not missing & {"settle_s", "unseen_pct", "end_position_mm", "camera_path_m"}


def test_peaks_count_from_the_time_asked_for(steps):
    at = steps[0].posture
    half = (at.upper[0] - at.lower[0]) / 2
    out = replace(at, joints=np.array([0.75 * half, 0.0, 0.0, 0.0, 0.0, 0.0]))
    first = exp_so3(np.array([0.2, 0.0, 0.0])) @ steps[0].truth.T_world_camera.rotation
    tilted = replace(steps[0].truth.T_world_camera, rotation=first)
    early = replace(steps[0], posture=out, truth=replace(steps[0].truth, T_world_camera=tilted))
    made = [early, *steps[1:]]
    assert report(made).measures["tilt_peak_deg"] == pytest.approx(np.degrees(0.2))
    assert report(made).measures["joint_range_peak_pct"] == pytest.approx(75.0)
    assert report(made, after=1.0).measures["tilt_peak_deg"] == pytest.approx(0.0, abs=1e-4)
    assert report(made, after=1.0).measures["joint_range_peak_pct"] < 50.0


def test_shares_and_settling_count_from_the_start(steps):
    made = [replace(s, limited=s.frame.index < 12) for s in steps]
    made = [off(s, 5.0 if s.frame.index < 40 else 0.5) for s in made]
    made = with_status(made, Status.LOST, range(12))
    for after in (0.0, 3.0):
        late = report(made, after=after)
        assert late.measures["saturated_pct"] == pytest.approx(10.0)
        assert late.measures["lost_pct"] == late.measures["unseen_pct"] == pytest.approx(10.0)
        assert late.measures["settle_s"] == pytest.approx(40 / 30)


def test_settling_ends_with_the_last_frame_that_is_off(steps):
    made = [off(s, 5.0 if s.frame.index in (0, 1, 40) else 0.5) for s in steps]
    assert report(made).measures["settle_s"] == pytest.approx(41 / 30)
    assert report([off(s, 5.0) for s in steps]).measures["settle_s"] == float("inf")
    assert report([off(s, 0.0) for s in steps]).measures["settle_s"] == 0.0


def test_longest_off_is_the_longest_stretch_above_the_limit(steps):
    made = [off(s, 6.0 if 10 <= s.frame.index < 25 or s.frame.index == 50 else 1.0) for s in steps]
    assert report(made, above=4.0).measures["longest_off_s"] == pytest.approx(15 / 30)
    assert report(made, above=7.0).measures["longest_off_s"] == 0.0


def test_angle_and_scale_errors_are_in_degrees_and_percent(steps):
    turned = [
        replace(s, truth=replace(s.truth, theta=s.goal.theta - 0.1, size=s.goal.size * 1.05))
        for s in steps
    ]
    assert report(turned).measures["servo_angle_rms_deg"] == pytest.approx(np.degrees(0.1))
    assert report(turned).measures["servo_scale_peak_pct"] == pytest.approx(5.0)


def test_tracking_angle_knows_front_from_back(steps):
    backwards = [
        replace(
            s,
            estimate=replace(
                s.estimate, state=replace(s.estimate.state, theta=s.truth.theta + np.pi)
            ),
        )
        for s in steps
    ]
    assert report(backwards).measures["tracking_angle_rms_deg"] == pytest.approx(180.0)


def with_status(steps, status, frames):
    return [
        replace(s, estimate=replace(s.estimate, status=status)) if s.frame.index in frames else s
        for s in steps
    ]


def test_unseen_and_lost_are_shares_of_all_frames(steps):
    made = with_status(steps, Status.UNSURE, range(10, 22))
    made = with_status(made, Status.LOST, range(22, 40))
    assert report(made).measures["unseen_pct"] == pytest.approx(100 * 30 / 120)
    assert report(made).measures["lost_pct"] == pytest.approx(100 * 18 / 120)


def test_a_limit_of_joints_or_of_speed_saturates(steps):
    joint = [replace(s, limited=s.frame.index < 12) for s in steps]
    speed = [replace(s, command=replace(s.command, saturated=s.frame.index < 30)) for s in steps]
    assert report(joint).measures["saturated_pct"] == pytest.approx(10.0)
    assert report(speed).measures["saturated_pct"] == pytest.approx(25.0)


def test_a_joints_range(steps):
    at = steps[0].posture
    half = (at.upper[0] - at.lower[0]) / 2
    out = replace(at, joints=np.array([0.75 * half, 0.0, 0.0, 9.0, 0.0, 0.0]))
    made = [replace(s, posture=out if s.frame.index == 7 else at) for s in steps]
    assert report(made).measures["joint_range_peak_pct"] == pytest.approx(75.0)
    assert made[7].margins[0] == pytest.approx(0.25 * half)
    assert made[7].margins[3] == np.inf


def test_effort_is_how_much_commands_change(steps):
    """Every second command is 30 mm/s and 0.2 rad/s more."""
    made = []
    for s in steps:
        twist = np.array([0.03, 0.0, 0.0, 0.0, 0.0, 0.2]) * (s.frame.index % 2)
        made.append(replace(s, command=replace(s.command, twist=twist), decided=True))
    measures = report(made).measures
    assert measures["effort_rms_mm_s"] == pytest.approx(30.0)
    assert measures["effort_rms_deg_s"] == pytest.approx(np.degrees(0.2))
    repeated = [replace(s, decided=s.frame.index % 2 == 0) for s in made]
    assert report(repeated).measures["effort_rms_mm_s"] == 0.0


def moved(step, place, heading, name="T_world_camera"):
    """The step with the camera, or the target, somewhere in the room."""
    pose = Pose(Pose.planar(0.0, 0.0, heading).rotation, np.array(place))
    return replace(step, truth=replace(step.truth, **{name: pose}))


def test_a_camera_that_gains_speed_at_once(steps):
    """It stands for 60 frames, and then moves by 0.1 m/s."""
    made = [moved(s, [0.1 / 30 * max(0, s.frame.index - 60), 0.0, 1.0], 0.0) for s in steps]
    measures = report(made).measures
    assert measures["acceleration_peak_m_s2"] == pytest.approx(0.1 * 30)
    assert measures["end_speed_mm_s"] == pytest.approx(100.0)
    assert report(made, after=3.0).measures["acceleration_peak_m_s2"] == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("turns", [0.0, 1.0, -2.0])
def test_acceleration_is_the_rooms_however_the_camera_turns(steps, turns):
    """On a circle of 0.3 m at 1 rad/s it is r w^2, on a line of constant speed nothing."""
    angles = [s.frame.time for s in steps]
    circle = [
        moved(s, [0.3 * np.cos(a), 0.3 * np.sin(a), 1.0], turns * a)
        for s, a in zip(steps, angles, strict=True)
    ]
    line = [moved(s, [0.3 * s.frame.time, 0.0, 1.0], turns * s.frame.time) for s in steps]
    on_circle = report(circle, after=1.0).measures
    on_line = report(line, after=1.0).measures
    assert on_circle["acceleration_peak_m_s2"] == pytest.approx(0.3, rel=1e-3)
    assert on_line["acceleration_peak_m_s2"] == pytest.approx(0.0, abs=1e-9)
    for measures in (on_circle, on_line):
        assert measures["end_speed_mm_s"] == pytest.approx(300.0, rel=1e-3)


def test_before_a_camera_that_stands_it_is_the_targets_acceleration(steps):
    """The target turns in place, which moves the camera as the target sees it, and then moves."""
    changes = ["run.duration=0.1", "controller.kind=hold"]
    with Episode(load("hand_plate", changes)) as episode:
        stands = next(iter(episode)).scene
    place = np.array([0.0, 0.0, 1.0])
    turning = [moved(s, place, s.frame.time, "T_world_target") for s in steps]
    ahead = np.array([0.1, 0.0, 0.0])
    moving = [moved(s, place + ahead * s.frame.time**2, 0.0, "T_world_target") for s in steps]
    for made, expected in ((turning, 0.0), (moving, 0.2)):
        measures = report([replace(s, scene=stands) for s in made], after=1.0).measures
        assert measures["acceleration_peak_m_s2"] == pytest.approx(expected, abs=1e-6)
    assert report([replace(s, scene=stands) for s in turning]).measures["end_speed_mm_s"] == 0.0


def test_the_way_of_the_joints_is_over_their_ranges(steps):
    """One of three joints with limits goes through half its range and back."""
    at = steps[0].posture
    span = at.upper[0] - at.lower[0]
    limited = np.isfinite(at.upper - at.lower).sum()
    there = replace(at, joints=at.joints + np.eye(6)[0] * span / 2)
    made = [replace(s, posture=there if s.frame.index == 7 else at) for s in steps]
    assert report(made).measures["joint_way_pct"] == pytest.approx(100 / limited)


def test_outcomes(steps):
    near, far, out = ([off(s, pixels) for s in steps] for pixels in (5.0, 40.0, 400.0))
    assert report(near).outcome is Outcome.CONVERGED
    assert report(far).outcome is Outcome.TIMED_OUT
    assert report(out).outcome is Outcome.DIVERGED
    limited = [replace(s, limited=True, joint_limits=("elbow (range)",)) for s in far]
    assert report(limited).outcome is Outcome.LIMIT_HIT
    assert report(limited).limits == ("elbow (range)",)
    for every, outcome in ((5, Outcome.LIMIT_HIT), (20, Outcome.TIMED_OUT)):
        now_and_then = [
            b if i % every else a for i, (a, b) in enumerate(zip(limited, far, strict=True))
        ]
        assert report(now_and_then).outcome is outcome
        assert report(now_and_then).limits == ("elbow (range)",)
    fast = [*far[:-1], replace(far[-1], limited=True, joint_limits=("elbow (speed)",))]
    assert (report(fast).outcome, report(fast).limits) == (Outcome.TIMED_OUT, ())
    lost = report(with_status(limited, Status.LOST, range(60, 120)))
    assert (lost.outcome, lost.limits) == (Outcome.TARGET_LOST, ("elbow (range)",))
    assert (report(far).limits, report(far).off) == ((), ("centre 40 px",))
    assert (report(near).off, report(out).off) == ((), ())
    assert report(with_status(near, Status.LOST, [119])).outcome is Outcome.TARGET_LOST


def test_a_run_that_is_out_of_time_says_the_most_of_all_that_was_off(steps):
    made = [off(s, 5.0) for s in steps]
    turned = replace(made[-9].truth, theta=made[-9].goal.theta + np.radians(27.0))
    grown = replace(made[-1].truth, size=1.4 * made[-1].goal.size)
    made[-9] = replace(made[-9], truth=turned)
    made[-1] = replace(made[-1], truth=grown)
    found = report(made)
    assert (found.outcome, found.off) == (Outcome.TIMED_OUT, ("angle 27 deg", "size 40 %"))
    assert found.outcome.sentence(found.limits, found.off) == (
        "The run ended before the camera was at the goal; largest errors of its last second: angle "
        "27 deg, size 40 %."
    )
    at_an_end = replace(made[-1], limited=True, joint_limits=("elbow (range)",))
    late = report([*made[:-1], at_an_end])
    assert late.outcome.sentence(late.limits, late.off) == (
        "The run ended before the camera was at the goal; joints at their limits: elbow (range); "
        "largest errors of its last second: angle 27 deg, size 40 %."
    )


@pytest.mark.wide
def test_a_run_that_ends_at_a_limit_names_the_joint(tmp_path, capsys, monkeypatch):
    """The gantry is to go higher than it can."""
    far = ["goal.depth=2.2", "start.scale=1.8", "tracker.kind=truth", "run.duration=4"]
    sets = [word for setting in far for word in ("--set", setting)]
    words = ["servobench", "run", "still", "--no-rerun", "--out", str(tmp_path / "run"), *sets]
    monkeypatch.setattr("sys.argv", words)
    with pytest.raises(SystemExit):
        main.main()
    sentence = "A limit of the robot keeps the camera from the goal: z (range)."
    assert f"seed 0: LIMIT_HIT. {sentence}" in " ".join(capsys.readouterr().out.split())
    assert section(tmp_path / "run").lead == sentence
    names = pq.read_table(tmp_path / "run" / "steps.parquet")["joint_limits"].to_pylist()
    assert (names[0], names[-1]) == ("", "z (range)")


def test_missed_bounds_say_what_was_found_and_expected(steps):
    made = report([off(s, 5.0) for s in steps])
    expect = {"servo_rms_px": 4.0, "servo_peak_px": 6.0, "settle_s": 3.0, "outcome": "TARGET_LOST"}
    assert [str(v) for v in missed_bounds(made.outcome.name, made.measures, expect)] == [
        "servo_rms_px is 5, expected at most 4",
        "settle_s is not finite, expected at most 3",
        "outcome is CONVERGED, expected TARGET_LOST",
    ]


def test_every_measure_is_there_and_finite_or_a_time_that_never_came(steps):
    made = report(steps)
    assert list(made.measures) == list(MEASURES)
    assert all(np.isfinite(v) for name, v in made.measures.items() if name != "settle_s")


def test_a_camera_that_stays_half_a_turn_from_its_goal_is_measured():
    changes = ["start.angle_deg=180", "controller.kind=hold", "run.duration=0.2", "expect={}"]
    _, report = measured_run(load("small_hybrid", ["start={}", *changes]))
    assert report.measures["end_rotation_deg"] == pytest.approx(180, abs=1e-6)
    assert report.measures["camera_path_m"] == pytest.approx(0, abs=1e-6)
    assert report.measures["out_of_view_pct"] == 0


@pytest.mark.wide
def test_the_turns_of_a_camera_add_up():
    changes = ["start={}", "start.angle_deg=60", "run.duration=6", "expect={}"]
    _, report = measured_run(load("small_hybrid", changes))
    left = report.measures["end_rotation_deg"]
    assert report.measures["camera_turn_deg"] == pytest.approx(60 - left, abs=0.02)
    # Half the diagonal of 0.2 m, 1 m away, at 600 px.
    assert report.measures["excursion_px"] == pytest.approx(60 * np.sqrt(2), abs=0.05)


def test_corners_on_the_border_of_the_picture_are_in_view(steps):
    camera = steps[0].scene.camera
    border = np.array(
        [[0, 0], [camera.width, 0], [camera.width, camera.height], [0, camera.height]]
    )

    def seen(corners):
        made = [replace(s, truth=replace(s.truth, corners=corners)) for s in steps]
        return report(made).measures["out_of_view_pct"]

    assert seen(border.astype(float)) == 0
    for k, axis, way in ((0, 0, -1), (0, 1, -1), (2, 0, 1), (2, 1, 1)):
        beyond = border.astype(float)
        beyond[k, axis] += 1e-6 * way
        assert seen(beyond) == 100


def test_a_perfect_tracker_has_no_error_in_frames_that_were_dropped():
    changes = ["tracker.kind=truth", "controller.kind=hold", "run.duration=2", "measure.after=0"]
    changes += ["vary={}", "expect={}", "disturbances.0.share=0.5"]
    steps, found = measured_run(load("dropped_frames", changes))
    assert not all(step.frame.fresh for step in steps)
    assert found.measures["tracking_rms_px"] == pytest.approx(0, abs=1e-9)


def test_a_target_behind_the_camera_is_neither_in_view_nor_at_its_goal():
    changes = ["robot.kind=free", "tracker.kind=truth", "controller.kind=hold", "vary={}"]
    scenario = load(
        "still", [*changes, "start.x=0", "run.duration=2.5", "measure.after=0", "expect={}"]
    )
    with Episode(scenario, steered=True) as episode:
        ahead = np.array([0.0, 0.0, 0.6, 0.0, 0.0, 0.0])
        steps = [episode.move(episode.look(), ahead) for _ in range(episode.frames)]
    behind = [step.truth.depth < 0 for step in steps]
    assert 10 < sum(behind) < len(behind) - 10
    found = summarise(steps, scenario.measure, 1 / scenario.camera.rate)
    assert found.measures["out_of_view_pct"] > 100 * np.mean(behind)
    assert found.measures["servo_rms_px"] == np.inf


@pytest.mark.parametrize("features", ["homography", "photometric"])
def test_a_law_on_pixels_is_not_at_its_goal_at_another_distance(features):
    changes = [f"features.kind={features}", "tracker.kind=frozen", "start={scale=1.6}", "vary={}"]
    changes += ["estimator.kind=none", "controller.gain=0.001", "run.duration=1.2", "expect={}"]
    _, found = measured_run(load("still", changes))
    assert (found.outcome, found.off) == (Outcome.TIMED_OUT, ("size 60 %",))
