from dataclasses import replace

import numpy as np
import pytest
from servoing import METRIC, PAPER, ROOT_AREA, facing, posture_of, task

from servo.controllers.hold import Config as HoldConfig
from servo.controllers.ibvs import Config, adaptive_gain
from servo.estimators import difference, error_kalman, none
from servo.features._interaction import interaction
from servo.sight import shape_moments
from servo.types import DOF, Mode, Sight
from tracking.types import Region, State

RNG = np.random.default_rng(0)
SQUARE = Region(0.2, 0.1)
DT = 1 / 30
STILL = posture_of(np.zeros(6))


def sight(x=0.0, y=0.0, theta=0.0, depth=1.0):
    m = shape_moments.of_polygon(SQUARE.corners(State(x, y, theta, 1 / depth)))
    return Sight(m, facing(m))


def started(config, estimator=none, features=METRIC, latency=0):
    controller = config.build(RNG)
    controller.start(task(sight(), estimator.Config().build(RNG), features, latency))
    return controller


def test_at_the_goal_nothing_moves():
    command = started(Config()).command(sight(), STILL, DT)
    np.testing.assert_allclose(command.twist, 0.0, atol=1e-12)


def test_features_are_made_to_decay_with_the_gain():
    controller, seen = started(Config(gain=2.0)), sight(0.05, -0.03, 0.2, 1.1)
    command = controller.command(seen, STILL, DT)
    rate = interaction(seen.moments, seen.plane, ROOT_AREA) @ command.twist
    np.testing.assert_allclose(rate, -2.0 * command.trace.error, atol=1e-12)


def test_both_scalings_command_the_same_motion():
    seen = sight(0.05, -0.03, 0.2, 1.1)
    metric, paper = (
        started(Config(), features=f).command(seen, STILL, DT).twist for f in (METRIC, PAPER)
    )
    np.testing.assert_allclose(metric, paper, atol=1e-12)


@pytest.mark.parametrize("matrix", ["current", "desired", "mean"])
def test_the_matrix_is_taken_where_it_was_asked_for(matrix):
    seen = sight(0.1, 0.05, 0.3, 1.2)
    command = started(Config(matrix=matrix)).command(seen, STILL, DT)
    here, there = (interaction(s.moments, s.plane, ROOT_AREA) for s in (seen, sight()))
    L = {"current": here, "desired": there, "mean": (here + there) / 2}[matrix][:, [0, 1, 2, 5]]
    twist = np.zeros(6)
    twist[[0, 1, 2, 5]] = -2.0 * np.linalg.solve(L, command.trace.error)
    np.testing.assert_allclose(command.twist, twist, atol=1e-12)


def test_masked_degrees_of_freedom_stay_zero_and_all_six_would_tilt():
    seen = sight(0.2, 0.1)
    masked = started(Config()).command(seen, STILL, DT).twist
    full = started(Config(dof=("vx", "vy", "vz", "wx", "wy", "wz"))).command(seen, STILL, DT)
    np.testing.assert_array_equal(masked[3:5], 0.0)
    # SERVO.md: half of every lateral motion is then done by rotation.
    assert np.abs(full.twist[3:5]).max() > 0.3 * np.abs(masked[:2]).max()


def drive(controller, x, k, step):
    """The target moves by `step` a frame in x; the camera stands still."""
    return controller.command(sight(x + k * step), STILL, DT)


def test_the_targets_motion_is_fed_forward_for_the_chosen_features():
    step = 0.1 * DT
    fed = started(Config(feed_forward=("xn",)), difference)
    unfed = started(Config(feed_forward=()), difference)
    for controller in (fed, unfed):
        drive(controller, 0.0, 0, step)
    a, b = (drive(c, 0.0, 1, step) for c in (fed, unfed))
    np.testing.assert_allclose(a.trace.prediction.motion[0], 0.1, rtol=1e-9)
    assert (a.twist - b.twist)[0] == pytest.approx(0.1, rel=1e-3)


def test_the_cameras_own_motion_is_not_taken_for_the_targets():
    controller, twist = started(Config(), difference), np.array([0.1, 0, 0, 0, 0, 0])
    controller.command(sight(0.0), STILL, DT)
    moved = controller.command(sight(-0.1 * DT), posture_of(twist), DT)
    np.testing.assert_allclose(moved.trace.prediction.motion, 0.0, atol=1e-9)


def test_without_sight_it_coasts_on_the_estimate_then_holds():
    controller = started(Config(coast=0.1), difference)
    for k in range(2):
        drive(controller, 0.01, k, 0.1 * DT)
    blind = [controller.command(None, STILL, DT).twist[0] for _ in range(5)]
    np.testing.assert_allclose(blind[:3], 0.1, rtol=1e-3)
    np.testing.assert_allclose(blind[3:], 0.0)


def test_a_fast_command_is_shortened_in_its_direction():
    seen = sight(0.4, 0.3)
    slow = started(Config(gain=1.0, fastest=99.0)).command(seen, STILL, DT)
    fast = started(Config(gain=1.0, fastest=0.1)).command(seen, STILL, DT)
    assert not slow.saturated
    assert fast.saturated
    assert np.linalg.norm(fast.twist[:3]) == pytest.approx(0.1)
    np.testing.assert_allclose(np.cross(slow.twist[:3], fast.twist[:3]), 0.0, atol=1e-12)


def test_hold_does_not_move_and_needs_no_features():
    command = drive(started(HoldConfig(), difference), 0.05, 1, 0.1 * DT)
    assert (command.twist.tolist(), command.trace) == ([0.0] * 6, None)


def closed_loop(gain, delay, steps=400):
    """Largest error over the last quarter of a kinematic loop along x, from 1 cm off."""
    controller, x, waiting = started(Config(gain=gain)), 0.01, [0.0] * delay
    errors = []
    for _ in range(steps):
        waiting.append(controller.command(sight(x), STILL, DT).twist[0])
        x -= waiting.pop(0) * DT
        errors.append(abs(x))
    return max(errors[-steps // 4 :])


def test_one_frame_of_delay_is_stable_below_lambda_t_of_one_and_not_above():
    assert closed_loop(gain=0.9 * 30, delay=1) < 1e-6
    assert closed_loop(gain=1.1 * 30, delay=1) > 1e-3


def test_features_that_are_not_known_are_left_as_they_are():
    seen = replace(sight(0.05, 0.02, 0.3, 1.2), angle_known=False, size_known=False)
    twist = started(Config()).command(seen, STILL, DT).twist
    np.testing.assert_array_equal(twist[2:], 0.0)
    assert twist[0] > 0.05
    whole = started(Config()).command(sight(0.05, 0.02, 0.3, 1.2), STILL, DT).twist
    assert np.all(np.abs(whole[[2, 5]]) > 0.1)


def test_a_fast_turn_is_shortened_too():
    seen = sight(0.0, 0.0, 1.0)
    command = started(Config(gain=1.0, fastest_turn=0.2)).command(seen, STILL, DT)
    assert command.saturated
    assert abs(command.twist[5]) == pytest.approx(0.2)


def test_the_gain_adapts_as_visp_has_it():
    config = Config(gain=4.0, gain_far=0.4, gain_slope=30.0)
    assert adaptive_gain(config, 0.0) == pytest.approx(4.0)
    assert adaptive_gain(config, 100.0) == pytest.approx(0.4)
    h = 1e-6
    slope = (adaptive_gain(config, h) - adaptive_gain(config, 0.0)) / h
    assert slope == pytest.approx(-30.0, rel=1e-4)
    assert adaptive_gain(Config(gain=2.0), 0.3) == 2.0
    near, far = (started(config).command(sight(x), STILL, DT).twist[0] / x for x in (1e-4, 0.3))
    assert near == pytest.approx(4.0, rel=0.02)
    assert far == pytest.approx(adaptive_gain(config, 0.3), rel=0.15)
    assert far < 0.8


def test_a_smooth_start_fades_in_from_rest():
    soft, hard = started(Config(smooth_start=4.0)), started(Config())
    seen = sight(0.05, -0.02, 0.1)
    first = soft.command(seen, STILL, DT).twist
    np.testing.assert_allclose(first, 0.0, atol=1e-12)
    whole = hard.command(seen, STILL, DT).twist
    for k in range(1, 30):
        twist = soft.command(seen, STILL, DT).twist
        np.testing.assert_allclose(twist, (1 - np.exp(-4.0 * k * DT)) * whole, atol=1e-12)


def test_a_smooth_start_waits_for_angle_and_size():
    """A tracker reports them from its second picture on."""
    seen = sight(0.05, -0.02, 0.3, 1.2)
    given = replace(seen, angle_known=False, size_known=False)
    soft = started(Config(smooth_start=4.0))
    whole = started(Config()).command(seen, STILL, DT).twist
    assert np.abs(whole[[2, 5]]).min() > 0.1
    for shown in (given, None, given, seen):
        command = soft.command(shown, STILL, DT)
    np.testing.assert_allclose(command.twist, 0.0, atol=1e-12)
    twist = soft.command(seen, STILL, DT).twist
    np.testing.assert_allclose(twist, (1 - np.exp(-4.0 * DT)) * whole, atol=1e-12)


def test_a_smooth_start_moves_nothing_for_features_that_are_no_longer_measured():
    seen = sight(0.0, 0.0, 0.3, 1.2)
    soft = started(Config(smooth_start=4.0))
    soft.command(seen, STILL, DT)
    assert np.abs(soft.command(seen, STILL, DT).twist).max() > 0.01
    lost = replace(seen, angle_known=False, size_known=False)
    np.testing.assert_allclose(soft.command(lost, STILL, DT).twist, 0.0, atol=1e-12)


def test_a_smooth_start_moves_nothing_while_no_error_is_predicted():
    """Alone, it would lead away from the goal."""
    soft = started(Config(smooth_start=4.0), difference)
    for _ in range(2):
        soft.command(sight(0.05), STILL, DT)
    for _ in range(3):
        np.testing.assert_allclose(soft.command(None, STILL, DT).twist, 0.0, atol=1e-12)


def test_a_slow_camera_searches_as_far_as_a_fast_one():
    farthest = []
    for fastest in (0.6, 0.05):
        law = started(Config(coast=0.0, search_after=0.0, fastest=fastest))
        place = np.zeros(3)
        while (command := law.command(None, STILL, DT)).mode is Mode.SEARCHING:
            place += command.twist[:3] * DT
        farthest.append(np.linalg.norm(place))
    np.testing.assert_allclose(farthest, 0.6, atol=0.01)


def test_weights_say_what_moves_and_the_features_decay_all_the_same():
    seen = sight(0.1, 0.05)
    for weight, share in ((1.0, 0.5), (0.1, 0.01)):
        weights = (1.0, 1.0, 1.0, weight, weight, 1.0)
        command = started(Config(dof=DOF, weights=weights)).command(seen, STILL, DT)
        rate = interaction(seen.moments, seen.plane, ROOT_AREA) @ command.twist
        np.testing.assert_allclose(rate, -2.0 * command.trace.error, atol=1e-12)
        # A small rectangle 1 m away: vx and wy move xn alike, so they share it as w^2 : 1.
        assert command.twist[4] / 0.2 == pytest.approx(share, rel=0.15)


def test_the_commands_under_way_are_counted_in():
    """With two frames of latency the filter on the error sees where they will have led."""
    controller, x = started(Config(gain=2.0), error_kalman, latency=2), 0.05
    waiting, past = [np.zeros(6)] * 2, np.zeros(6)
    for k in range(60):
        command = controller.command(sight(x), posture_of(past), DT)
        if k > 5:
            expected = x - DT * sum(w[0] for w in waiting)
            assert command.trace.prediction.error[0] == pytest.approx(expected, abs=1e-4)
        waiting.append(command.twist)
        past = waiting.pop(0)
        x -= DT * past[0]
    assert abs(x) < 2e-3


def test_another_goal_is_gone_to():
    controller = started(Config())
    assert controller.command(sight(), STILL, DT).twist[2] == pytest.approx(0.0, abs=1e-9)
    command = controller.command(replace(sight(), goal=sight(depth=0.8)), STILL, DT)
    assert command.trace.error[2] == pytest.approx(0.2)
    assert command.twist[2] == pytest.approx(0.4, rel=1e-6)
