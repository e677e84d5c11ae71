"""Time that counts: slow trackers, late pictures, and what is under way meanwhile."""

import time
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from measured import measured_run
from numpy.testing import assert_allclose, assert_array_equal

from servo.controllers._pending_commands import PendingCommands
from servo.loop.episode import Episode
from servo.loop.run_measures import summarise
from servo.loop.settings import MeasureConfig
from servo.mistake import Mistake
from servo.scenario.load import load
from servo.study.run import Job
from servo.study.scenario_run import LoadedScenario, record_of
from sim.types import Pose, Posture

T = 1 / 30
SPEED = 29.0
"""Of the car of `reversal` in the image: 0.1 m/s, f = 290 px, depth 1 m [px/s]."""


def stepped(name, *changes, seed=0):
    """The steps of a run with a perfect tracker, unless the changes name another one."""
    scenario = load(name, ["tracker.kind=truth", *changes], seed=seed)
    with Episode(scenario, seen=False) as episode:
        return list(episode)


def decided(steps):
    """The first step of each decision."""
    return [s for i, s in enumerate(steps) if i == 0 or s.command is not steps[i - 1].command]


def pictures(steps):
    """Numbers of the pictures that the tracker took, one for each decision."""
    taken = [s.truth_estimated for s in decided(steps)]
    return [next(i for i, s in enumerate(steps) if s.truth is truth) for truth in taken]


@pytest.mark.parametrize(
    ("ms", "taken", "age"),
    [
        (0.0, range(12), 0.0),
        (20.0, range(12), 0.02),
        (33.0, range(12), 0.033),
        (40.0, [0, 1, 2, 3, 4, 5, 7, 8, 9, 10], None),
        (100.0, [0, 1, 4, 7], 0.1),
    ],
)
def test_a_free_tracker_takes_the_newest_picture(ms, taken, age):
    steps = stepped("line", f"run.tracker_ms={ms}", "run.duration=0.4")
    found = pictures(steps)
    assert found == list(taken)[: len(found)]
    assert len(found) >= len(list(taken)) - 1
    if age is not None:
        assert_allclose([s.age for s in decided(steps)][1:], age, atol=1e-12)
    assert decided(steps)[0].age == 0.0  # the first state is given
    assert decided(steps)[-1].skipped == found[-1] + 1 - len(found)


def test_a_command_acts_the_latency_after_its_estimate_from_the_next_tick_on():
    steps = stepped("line", "run.tracker_ms=40", "run.duration=0.5", "start.x=-20")
    second = decided(steps)[1]  # picture 1 at 33.3 ms, estimate at 73.3 ms, acts at 106.7 ms
    assert second.truth_estimated is steps[1].truth
    # Ticks are 8.33 ms apart, so it acts from 108.3 ms on: of frame 3 (100 to 133.3 ms) 3 of 4.
    first = decided(steps)[0].command.twist
    assert_allclose(steps[3].twist_acting, first / 4 + 3 * second.command.twist / 4, atol=1e-12)


def test_the_law_learns_of_what_is_under_way():
    postures = []
    with Episode(load("line", ["run.tracker_ms=40", "run.duration=0.5"])) as episode:
        real = episode.running.decide
        episode.running.decide = lambda o, p, *a: postures.append(p) or real(o, p, *a)
        steps = list(episode)
    twists = [s.command.twist for s in decided(steps)]
    third = postures[2]  # picture 2 at 66.7 ms; its command acts from 150 ms on, that before 108.3
    assert_allclose([held for _, held in third.under_way], [5 * T / 4, 5 * T / 4], atol=1e-9)
    assert_array_equal([twist for twist, _ in third.under_way], twists[:2])


@pytest.mark.newest
def test_motion_is_paired_with_the_time_between_the_two_pictures():
    steps = stepped("line", "run.tracker_ms=100", "run.duration=3.0", "run.latency=0")
    assert {s.seconds.control for s in steps if not s.decided} == {0.0}
    late = decided(steps)[10:]
    for step in late:
        measured, true = step.motion_measured[0], step.target_motion_true[0]
        assert measured == pytest.approx(true, rel=0.15)  # 0.2 px of noise over 0.1 s
    assert np.mean([s.motion_measured[0] for s in late]) == pytest.approx(0.1, rel=0.01)


@pytest.mark.parametrize("ms", [0.0, 33.0, 100.0, 250.0])
@pytest.mark.newest
def test_the_error_at_a_reversal_is_what_the_delay_lets_it_grow_to(ms):
    """2 v f / Z over the time until a command answers it: at most the interval between the pictures
    that are taken, the age of the estimate, and the latency."""
    changes = "run.duration=4.0", "estimator.kind=difference", f"run.tracker_ms={ms}"
    steps = stepped("reversal", *changes)
    age = steps[-1].age
    interval = np.ceil(max(age, T) / T - 1e-6) * T
    most = 2 * SPEED * (interval + age + T)
    peak = max(s.servo_error for s in steps if s.frame.time > 2.0)
    assert 0.85 * most < peak < 1.05 * most


@pytest.mark.wide
def test_no_estimator_is_worse_than_none_with_a_slow_tracker():
    """Where the tracker keeps the car, which at this delay depends on the seed and the renderer."""
    changes = "run.duration=6.0", "run.tracker_ms=250", "measure.after=2.0"
    kinds = "none", "difference", "kalman_cv", "kalman_ca", "jump", "error_kalman", "imm"
    none, *others = (
        measured_run(load("reversal", [*changes, f"estimator.kind={k}"], seed=1))[1].measures
        for k in kinds
    )
    assert max(run["tracking_rms_px"] for run in (none, *others)) < 1.0
    assert max(run["servo_rms_px"] for run in others) < 0.8 * none["servo_rms_px"]


@pytest.mark.wide
def test_one_frame_of_delay_costs_a_predicting_estimator_nothing():
    changes = "estimator.kind=error_kalman", "run.tracker_ms=33"
    assert measured_run(load("line", changes))[1].measures["servo_rms_px"] < 1.0


def test_pictures_arrive_late_and_in_order():
    shown = []
    with Episode(load("line", ["run.jitter_ms=60", "run.duration=3.0"], seed=4)) as episode:
        real = episode.running.track
        episode.running.track = lambda f, p: shown.append(f.index) or real(f, p)
        steps = list(episode)
        assert not episode._timeline.is_known_ahead
    assert shown == sorted(set(shown))
    ages = np.array([s.age for s in decided(steps)])
    assert 0.02 < ages.mean() < 0.05
    assert ages.max() < 0.06
    assert steps[-1].skipped == shown[-1] + 1 - len(shown) > 3
    again = stepped("line", "run.jitter_ms=60", "run.duration=3.0", seed=4)
    assert [s.age for s in again] == [s.age for s in steps]


def test_a_measured_tracker_is_as_old_as_it_took():
    steps = stepped("line", "run.tracker_ms=measured", "run.duration=1.0")
    taken = decided(steps)[1:]
    assert len(taken) > 5
    assert all(s.age >= s.seconds.track > 0 for s in taken if s.age < T)


class Sleeper:
    """A tracker that takes longer than two frames."""

    def init(self, image, rect):
        self.rect = rect

    def update(self, image):
        time.sleep(0.08)
        return True, self.rect


@pytest.mark.wide
def test_times_are_of_the_frames_in_which_the_tracker_worked():
    """Nearly all frames of a slow tracker are without a call: medians over all would be near 0."""
    scenario = load("still", ["run.tracker_ms=measured", "run.duration=1"], tracker=Sleeper)
    record = record_of(Job(0, LoadedScenario(scenario), 0), scenario, measured_run(scenario)[0])
    assert record.measures["track_ms"] > 80
    assert record.measures["step_ms"] > 80
    assert record.measures["age_ms"] > 80


@pytest.mark.parametrize("latency", [0, 1])
def test_the_physics_of_a_frame_is_counted_once(monkeypatch, latency):
    """On a clock that only physics moves on, by 1 s for each frame interval."""
    scenario = load("still", ["tracker.kind=truth", f"run.latency={latency}", "run.duration=0.1"])
    clock = SimpleNamespace(now=0.0)
    with Episode(scenario, seen=False) as episode:
        advance = episode.world.step

        def step(twists):
            clock.now += 1.0
            return advance(twists)

        monkeypatch.setattr(episode.world, "step", step)
        monkeypatch.setattr("servo.loop.episode.perf_counter", lambda: clock.now)
        found = [(s.seconds.render, s.seconds.physics) for s in episode]
    assert found == [(0.0, 1.0)] * 3


def test_the_age_is_a_mean_over_estimates():
    """Frames between two estimates repeat the age of the last one; the first state is given."""
    steps = stepped("line", "run.tracker_ms=100", "run.duration=1.0")
    found = summarise(steps, MeasureConfig(), T).measures["age_ms"]
    assert_allclose(found, 100.0, atol=1e-9)


@pytest.mark.parametrize("ms", [0, 100])
def test_a_tracker_is_judged_by_each_estimate_once(ms):
    """The frames that repeat an estimate say nothing more of it."""
    changes = f"run.tracker_ms={ms}", "run.duration=1.0", "tracker.kind=mean_shift"
    steps = stepped("line", *changes)
    late = [s for s in steps if s.frame.time >= 0.5 and s.decided]
    assert len(late) == (15 if ms == 0 else 5)
    values = summarise(steps, MeasureConfig(after=0.5), T).measures
    errors = np.array([s.tracking_error for s in late])
    assert_allclose(values["tracking_rms_px"], np.sqrt(np.mean(errors**2)), rtol=1e-12)
    assert_allclose(values["tracking_peak_px"], errors.max(), rtol=1e-12)


def test_a_frame_that_is_not_later_is_refused():
    with Episode(load("line", ["run.duration=0.1"])) as episode:
        step = next(iter(episode))
        with pytest.raises(ValueError, match=r"expected a time after .* 0.0 s, got 0.0 s"):
            episode.running.step(step.frame, step.posture)


@pytest.mark.parametrize("offset", [-50.0, -33.4, -10.0, 20.0])
def test_a_wrong_stamp_pairs_a_picture_with_another_moment(offset):
    """The robot's own pose at the stamp, of those it knows; the mean twist is between two such."""
    postures = []
    changes = f"believed.clock_offset_ms={offset}", "run.tracker_ms=33", "run.duration=1.5"
    with Episode(load("sine", [*changes, "start.x=-20"])) as episode:
        real = episode.running.track
        episode.running.track = lambda f, p: postures.append((f, p)) or real(f, p)
        steps = list(episode)
    own = [s.posture.T_base_camera.translation for s in steps]
    for frame, posture in postures[10:-3]:
        # The posture of a picture that was just taken is the newest: none is known of later.
        at = frame.index + min(offset, 0.0) * 1e-3 / T
        i = int(np.floor(at))
        expected = own[i] + (at - i) * (own[min(i + 1, len(own) - 1)] - own[i])
        assert_allclose(posture.T_base_camera.translation, expected, atol=2e-6)  # screw, not line


def test_a_wrong_clock_is_taken_for_motion_of_the_target():
    """Where the camera accelerates, the wrong part of its motion is taken out of de/dt."""

    def rms(offset):
        changes = f"believed.clock_offset_ms={offset}", "run.duration=6.0"
        steps = stepped("sine", *changes)[30:]
        return np.sqrt(
            np.mean([(s.motion_measured[0] - s.target_motion_true[0]) ** 2 for s in steps])
        )

    assert rms(-100.0) > 1.5 * rms(0.0)


def test_a_dropped_frame_neither_displaces_a_picture_nor_takes_time():
    with Episode(load("line", ["run.tracker_ms=60", "run.duration=0.5"])) as episode:
        begin = episode.world.begin

        def dropping():
            picture = begin()

            def shown_or_dropped():
                frame = picture()
                return replace(frame, fresh=frame.index not in (2, 5, 8, 9))

            return shown_or_dropped

        shown, track = [], episode.running.track
        episode.running.track = lambda f, p: shown.append(f.index) or track(f, p)
        episode.world.begin = dropping
        steps = list(episode)
    # Picture 1 is taken at 33 ms and done at 93, when only the dropped frame 2 has come: nothing
    # is seen in it, so it is done at once. Picture 3 (100 ms) is done at 160, 4 (133 ms) at 220, 6
    # (200 ms, not the dropped 5) at 280, then 7 (233 ms, not the dropped 8).
    assert shown == [0, 1, 2, 3, 4, 6, 7, 10, 12, 13]
    assert decided(steps)[1].age == pytest.approx(0.06 + T - 2 * T)
    assert steps[-1].skipped == 1  # picture 11


@pytest.mark.parametrize(
    ("ms", "acts"),
    [
        (0.0, 0.0),
        (1.0, 1 / 120),  # rounded up to the next update of the drives
        (80.0, 10 / 120),
        (1000 / 30, 1 / 30),
        (100.0, 0.1),
    ],
)
def test_a_latency_in_milliseconds_acts_from_the_next_update_of_the_drives_on(ms, acts):
    steps = stepped("line", f"run.latency_ms={ms}", "run.duration=0.5", "start.x=-20")
    first = next(s for s in steps if s.twist_acting.any())
    assert first.frame.index == int(acts / T + 1e-9)
    share = 1 - (acts - first.frame.time) / T
    assert_allclose(first.twist_acting, share * steps[0].command.twist, atol=1e-12)


def test_a_latency_of_whole_frames_is_the_same_in_milliseconds():
    in_frames, in_time = (
        stepped("line", change, "run.duration=0.7", "start.x=-20")
        for change in ("run.latency=2", "run.latency_ms=66.66666666666667")
    )
    for one, other in zip(in_frames, in_time, strict=True):
        assert_allclose(one.command.twist, other.command.twist, atol=1e-9)
        assert_allclose(one.twist_acting, other.twist_acting, atol=1e-9)


def test_the_law_learns_how_long_the_first_of_its_pending_commands_still_acts():
    pending = PendingCommands(2.4)
    for k in range(5):
        pending.add(np.full(6, float(k)))
    posture = Posture(
        Pose(np.eye(3), np.zeros(3)), np.zeros(6), *[np.zeros(0)] * 3, np.zeros((6, 0))
    )
    found = pending.coming(posture, T)
    assert [twist[0] for twist, _ in found] == [2.0, 3.0, 4.0]
    assert_allclose([share for _, share in found], [0.4, 1.0, 1.0])
    assert PendingCommands(0).coming(posture, T) == []


@pytest.mark.parametrize(
    "run", ["[run]\nlatency_ms = 80", "[vary]\nrun.latency_ms = { choice = [40, 80] }"]
)
def test_a_latency_that_is_set_takes_the_place_of_a_file_s_in_another_unit(tmp_path, run):
    (tmp_path / "mine.toml").write_text(run)
    for seed in (0, 3):
        late = load(str(tmp_path / "mine.toml"), ["run.latency=2"], seed).run
        assert (late.latency, late.latency_ms) == (2, None)
    (tmp_path / "mine.toml").write_text("[run]\nlatency = 2")
    assert load(str(tmp_path / "mine.toml"), ["run.latency_ms=80"]).run.latency_ms == 80


@pytest.mark.parametrize("frames", [1, 2])  # also the default, where it is written
def test_a_latency_in_frames_and_in_milliseconds_exclude_each_other(frames):
    with pytest.raises(
        Mistake, match=r"run: latency and latency_ms give the same delay; leave one"
    ):
        load("line", ["run.latency_ms=80", f"run.latency={frames}"])
