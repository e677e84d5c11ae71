"""Estimation over intervals: innovations that are white and as large as expected, hidden targets,
what the camera itself causes, and what limits let through.
"""

import numpy as np
import pytest
from servoing import METRIC, begun, own, plane_of, posture_of, task

from servo.controllers._pending_commands import PendingCommands
from servo.controllers.ibvs import Config as Ibvs
from servo.estimators import difference, error_kalman, imm, jump, kalman_ca, kalman_cv
from servo.features.moments import NOISE
from servo.loop.episode import Episode
from servo.scenario.load import load
from servo.sight import shape_moments
from servo.types import OwnMotion, Sight
from sim.channels import View
from sim.geometry import exp_se3
from sim.types import Pose

FILTERS = [kalman_cv, kalman_ca, jump, error_kalman, imm]
DT = 1 / 30
RECTANGLE = np.array([[-0.1, -0.05, 0], [0.1, -0.05, 0], [0.1, 0.05, 0], [-0.1, 0.05, 0]])
DOWN = Pose(np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, 1.0]))


def build(kind):
    return begun(kind.Config().build(np.random.default_rng(0)))


def lag_1(series):
    z = series - series.mean(axis=0)
    return (z[1:] * z[:-1]).sum(axis=0) / (z * z).sum(axis=0)


def normalised(predictions):
    return np.array([np.sign(p.innovation) * np.sqrt(p.nis) for p in predictions])


def noisy(count, speed, level, rng, hidden=range(0)):
    """Errors of a target at a speed (per frame a number), with noise of which half persists; nan
    where it is hidden."""
    error, noise, found = np.zeros(4), np.zeros(4), []
    for k in range(count):
        error = error + DT * speed[k]
        noise = 0.5 * noise + np.sqrt(0.75) * level * rng.normal(0, NOISE)
        found.append(np.full(4, np.nan) if k in hidden else error + noise)
    return found


@pytest.mark.parametrize("kind", FILTERS)
@pytest.mark.parametrize("level", [0.5, 5.0])
def test_innovations_are_white_and_as_large_as_expected_at_any_noise(kind, level):
    rng = np.random.default_rng(1000)
    estimator = build(kind)
    errors = noisy(700, np.full(700, 0.05), level, rng)
    z = normalised([estimator.update(e, own(np.zeros(4)), DT) for e in errors][100:])
    assert np.all(np.abs(np.mean(z**2, axis=0) - 1) < 0.2)
    # Not zero: the target does not manoeuvre, and the filters allow for it.
    assert np.all(np.abs(lag_1(z)) <= 0.35)


def test_the_noise_of_differences_is_not_white():
    rng, estimator = (
        np.random.default_rng(1000),
        begun(kalman_cv.Config(noise="difference").build(np.random.default_rng(0))),
    )
    errors = np.cumsum(np.full((1500, 4), 0.05 * DT), axis=0) + rng.normal(0, NOISE, (1500, 4))
    z = normalised([estimator.update(e, own(np.zeros(4)), DT) for e in errors][100:])
    assert np.all(lag_1(z) < -0.4)


MOVING = {"line": [0], "sine": [0], "wander": [0, 3]}
"""Features that move."""


@pytest.mark.wide
@pytest.mark.parametrize(("name", "seed"), [("line", 1000), ("sine", 1001), ("wander", 1002)])
@pytest.mark.newest
def test_innovations_in_the_rendered_loop(name, seed):
    """The filters see what one of them, in the loop, makes of the pictures."""
    watched = {kind: build(kind) for kind in FILTERS}
    found = {kind: [] for kind in FILTERS}
    with Episode(load(name, ["run.duration=9.0", "vary={}"], seed=seed)) as episode:
        for step in episode:
            trace = step.command.trace
            errors, seen = trace.error / trace.scales, OwnMotion(trace.own, np.zeros((0, 4)))
            for kind in FILTERS:
                found[kind].append(watched[kind].update(errors, seen, DT))
    for kind in FILTERS:
        z = normalised(found[kind][60:])[:, MOVING[name]]
        nis, lag = np.mean(z**2, axis=0), lag_1(z)
        assert np.all((nis > 0.5) & (nis < 2.0)), (kind, nis)
        # A sine is not of constant velocity: kalman_cv has 0.21 to 0.35 (seeds 1, 2, 1001) with
        # OpenGL's pictures, 0.13 to 0.34 with exact ones; that of one run is known to 0.07.
        assert np.all(np.abs(lag) <= 0.4), (kind, lag)


@pytest.mark.parametrize("kind", FILTERS)
@pytest.mark.parametrize("seed", range(1000, 1005))
def test_a_target_that_turned_around_while_hidden_is_taken_up_within_three_frames(kind, seed):
    speed, hidden = np.repeat([0.1, -0.1], [75, 60])[:, None] * np.ones(4), range(60, 90)
    estimator, rest, motions = build(kind), own(np.zeros(4)), []
    for error in noisy(93, speed, 4.0, np.random.default_rng(seed), hidden):
        gone = np.isnan(error).all()
        done = estimator.skip(rest, DT) if gone else estimator.update(error, rest, DT)
        motions.append(done.motion[:2])
    np.testing.assert_allclose(motions[59], 0.1, atol=0.02)
    np.testing.assert_allclose(motions[62], 0.1, atol=0.025)  # it coasts
    np.testing.assert_allclose(motions[92], -0.1, atol=0.02)  # 20 %


@pytest.mark.parametrize("kind", FILTERS)
def test_what_was_hidden_is_less_certain_with_each_frame(kind):
    """The first innovation afterwards counts for less surprise, the longer nothing was seen."""
    nis = []
    for gap in (1, 5, 20):
        estimator, rest = build(kind), own(np.zeros(4))
        for error in noisy(90, np.full(90, 0.1), 1.0, np.random.default_rng(3)):
            estimator.update(error, rest, DT)
        for _ in range(gap):
            ahead = estimator.skip(rest, DT)
        off = 9 * DT + (gap + 1) * DT * ahead.motion + 20 * NOISE
        nis.append(estimator.update(off, rest, DT).nis[0])
    assert nis[0] > 3 * nis[1] > 9 * nis[2]


@pytest.mark.parametrize("kind", [difference, *FILTERS])
def test_a_feature_that_was_not_measured_harms_no_other_and_not_itself(kind):
    whole, holed = build(kind), build(kind)
    for k, error in enumerate(noisy(60, np.full(60, 0.1), 1.0, np.random.default_rng(4))):
        partly = error.copy()
        if k < 2 or 30 <= k < 33:
            partly[2:] = np.nan
        a, b = (e.update(z, own(np.zeros(4)), DT) for e, z in ((whole, error), (holed, partly)))
        np.testing.assert_allclose(b.motion[:2], a.motion[:2], rtol=1e-9)
        assert np.all(np.isfinite([b.error, b.motion]))
        assert np.isnan(b.nis[2:]).all() or np.isfinite(partly[2:]).all()
    # Differences are noise; what filters estimate is the same again soon.
    np.testing.assert_allclose(b.motion, a.motion, atol=1e-9 if kind is difference else 0.02)


def seen_from(T_world_camera, T_world_target):
    T = T_world_camera.inverse() @ T_world_target
    points = T.apply(RECTANGLE)
    moments = shape_moments.of_polygon(points[:, :2] / points[:, 2:])
    return Sight(moments, plane_of(T, 0.0))


class Listener:
    """An estimator that keeps what it is given."""

    def start(self, features):
        self.given, self.owns = [], []

    def update(self, error, own, dt):
        self.given.append(error)
        self.owns.append(own)
        return difference.Prediction.unmeasured(np.nan_to_num(error), np.zeros(len(error)))

    def skip(self, own, dt):
        return self.update(np.zeros(4), own, dt)


def turning(interval, rate, latency=0):
    """A camera that drives and turns over a target at rest: what is given to the estimator, and the
    largest error [1/s] of the own motion of the past, and of the interval to come, per frame."""
    dt, twist = 1 / rate, np.array([0.1, 0.05, 0.0, 0.0, 0.0, 0.8])
    listener, camera = Listener(), DOWN
    law = Ibvs(interval=interval).build(np.random.default_rng(0))
    law.start(task(seen_from(DOWN, Pose.planar(0, 0, 0)), listener, latency=latency))
    for _ in range(int(0.8 * rate)):
        law.command(seen_from(camera, Pose.planar(0.05, 0.02, 0.0)), posture_of(twist), dt)
        law._pending.add(twist)
        camera = camera @ exp_se3(twist * dt)
    change = np.diff(listener.given, axis=0) / dt
    past = np.array([o.past for o in listener.owns[1:]]) - change
    coming = np.array([o.coming[0] for o in listener.owns[1:-1]]) - change[1:] if latency else 0
    return np.abs(past[1:, :2]).max(), np.abs(coming).max()


def test_the_mean_of_both_ends_is_what_a_turning_camera_causes():
    bias = {(i, rate): turning(i, rate)[0] for i in ("mean", "end") for rate in (30, 5)}
    assert bias["end", 30] > 1e-3
    assert bias["end", 5] > 8e-3
    assert bias["mean", 30] < 3e-5
    assert bias["mean", 5] < 1e-3


def test_the_matrix_goes_on_changing_in_the_frames_to_come():
    end, mean = (turning(interval, 30, latency=1)[1] for interval in ("end", "mean"))
    assert mean < 0.1 * end


def scales_of(goal):
    """The scales of the features whose goal this is."""
    return METRIC.scales(METRIC.values(goal))


def test_after_a_gap_only_the_last_matrix_is_known():
    listener, twist = Listener(), np.array([0.1, 0.0, 0.0, 0.0, 0.0, 0.8])
    law = Ibvs().build(np.random.default_rng(0))
    law.start(task(seen_from(DOWN, Pose.planar(0, 0, 0)), listener))
    sights = [seen_from(DOWN, Pose.planar(x, 0, x)) for x in (0.0, 0.1, 0.2, 0.3)]
    for sight in (sights[0], sights[1], None, sights[2], sights[3]):
        law.command(sight, posture_of(twist), DT)
    given = [o.past * scales_of(sights[0]) for o in listener.owns]
    L = [METRIC.matrix(sight) for sight in sights]
    expected = [L[0], (L[0] + L[1]) / 2, L[1], L[2], (L[2] + L[3]) / 2]
    np.testing.assert_allclose(given, [matrix @ twist for matrix in expected], atol=1e-12)


def test_what_limits_let_through_is_under_way():
    x, y = np.eye(6)[:2]
    commands = PendingCommands(3)
    for twist in (0.4 * x, 0.4 * x + 0.1 * y, 0.1 * x, -0.4 * x):
        commands.add(twist)
    as_asked = [twist for twist, _ in commands.coming(posture_of(np.zeros(6)), DT)]
    np.testing.assert_allclose(as_asked, [0.4 * x + 0.1 * y, 0.1 * x, -0.4 * x])
    posture = posture_of(np.zeros(6), accepted=0.4 * x)
    np.testing.assert_allclose([t for t, _ in commands.coming(posture, DT)], as_asked)
    slowed = commands.coming(posture_of(np.zeros(6), accepted=0.2 * x), DT)
    np.testing.assert_allclose([t for t, _ in slowed], [0.2 * x + 0.05 * y, 0.1 * x, -0.4 * x])


def test_ideal_feed_forward_leaves_no_error_in_a_kinematic_loop():
    """As ViSP's loops with a moving target: de/dt = L (-R V, 0) over the next interval."""
    from servo.estimators import true

    estimator, V, dt = true.Config().build(np.random.default_rng(0)), np.array([0.1, 0.05, 0]), 0.04
    law = Ibvs(interval="end").build(np.random.default_rng(0))
    law.start(task(seen_from(DOWN, Pose.planar(0, 0, 0)), estimator))
    scales = scales_of(seen_from(DOWN, Pose.planar(0, 0, 0)))
    camera, twist, target = DOWN, np.zeros(6), np.zeros(3)
    for k in range(100):
        V = -V if k == 50 else V
        sight = seen_from(camera, Pose(np.eye(3), target))
        relative = np.concatenate([-camera.rotation.T @ V, np.zeros(3)])
        estimator.see(View(true_motion=METRIC.matrix(sight) @ relative / scales))
        command = law.command(sight, posture_of(twist), dt)
        assert np.abs(command.trace.error).max() < 1e-12
        twist, target = command.twist, target + V * dt
        camera = camera @ exp_se3(twist * dt)
