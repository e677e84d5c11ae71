"""The tracker `truth`: its stated errors, and runs in which nobody looks at a picture."""

import numpy as np
import pytest
from measured import measured_run

import servo
from servo.loop.episode import Episode
from servo.mistake import Mistake
from tracking import create
from tracking.types import Region, State, Status

SHORT = ["tracker.kind=truth", "run.duration=1"]


def steps_of(name, *changes):
    return measured_run(servo.load(name, [*SHORT, *changes]))[0]


def test_it_reports_the_truth():
    for step in steps_of("circle"):
        state, truth = step.estimate.state, step.truth
        np.testing.assert_array_equal((state.x, state.y), truth.centre)
        assert state.theta == truth.theta
        assert step.scene.first_size * state.scale == pytest.approx(truth.size, rel=1e-12)


def test_its_errors_are_as_large_as_it_says():
    """150 pictures: a standard deviation is known to 6 %, so 20 % is over three times that."""
    noisy = "tracker.noise=2", "tracker.angle_noise_deg=3", "tracker.scale_noise_pct=4"
    steps = steps_of("still", *noisy, "tracker.corners=true", "run.duration=5")[1:]
    errors = [
        (
            s.estimate.state.x - s.truth.centre[0],
            np.degrees(s.estimate.state.theta - s.truth.theta),
            100 * np.log(s.estimate.state.scale * s.scene.first_size / s.truth.size),
            *(s.estimate.corners - s.truth.corners)[1:3, 1],
        )
        for s in steps
    ]
    np.testing.assert_allclose(np.std(errors, axis=0), [2, 3, 4, 2, 2], rtol=0.2)
    assert abs(np.corrcoef(np.transpose(errors)) - np.eye(5)).max() < 0.3
    np.testing.assert_allclose(np.diag(steps[0].estimate.covariance), [4, 4, 0.00274, 0.0016], 3e-3)


@pytest.mark.wide
def test_it_misses_a_share_of_the_pictures():
    steps = steps_of("line", "tracker.dropouts=0.3", "run.duration=10")
    unsure = np.mean([s.estimate.status is Status.UNSURE for s in steps])
    assert unsure == pytest.approx(0.3, abs=0.08)  # three standard deviations of 300 draws
    never = steps_of("line", "tracker.dropouts=1")
    assert {s.estimate.status for s in never[1:]} == {Status.UNSURE}


def test_it_is_lost_outside_the_picture():
    steps = steps_of("line", "controller.gain=1e-6", "estimator.kind=none", "run.duration=6")
    outside = [s for s in steps if not 0 <= s.truth.centre[0] <= 320]
    assert len(outside) > 10
    assert {s.estimate.status for s in outside} == {Status.LOST}


def test_where_nobody_looks_nothing_is_rendered_and_the_numbers_are_the_same():
    scenario = servo.load("six_motion", [*SHORT, "tracker.corners=true", "tracker.noise=0.5"])
    unseen, summary = measured_run(scenario)
    seen = []
    _, other = measured_run(scenario, lambda step: seen.append(step.frame.image.any()))
    assert all(seen)
    timed = {"step_ms"}
    assert {k: v for k, v in summary.measures.items() if k not in timed} == {
        k: v for k, v in other.measures.items() if k not in timed
    }
    with Episode(scenario, seen=False) as episode:
        assert not episode.world.look().image.any()
    for looks in ("features.kind=photometric", "world.visibility=true", "tracker.kind=pf_ssd"):
        with Episode(servo.load("still", [*SHORT, looks]), seen=False) as episode:
            assert episode.world.look().image.any()
    assert len(unseen) == 30


def test_without_a_simulation_it_says_so():
    tracker = create("truth")
    picture = np.zeros((100, 100, 3), np.uint8)
    with pytest.raises(
        ValueError, match="needs the true pose of the target, which only a simulation provides"
    ):
        tracker.start(picture, Region(20, 20), State(50, 50, 0, 1))


def test_its_settings_have_a_range():
    with pytest.raises(Mistake, match=r"tracker.dropouts = 2: .*less than or equal to 1"):
        servo.load("line", ["tracker.kind=truth", "tracker.dropouts=2"])
