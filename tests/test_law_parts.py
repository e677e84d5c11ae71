"""The parts of the control law by themselves: null space, secondary tasks, limits, loss."""

import numpy as np
import pytest
from servoing import facing, posture_of

from servo.controllers._inverse import FAR, Inverse, twist_of
from servo.controllers._limits import Limits
from servo.controllers._target_loss import TargetLoss
from servo.features._interaction import interaction
from servo.sight import shape_moments
from servo.types import Mode
from sim.geometry import exp_so3
from sim.types import Pose, Posture

DT = 1 / 30
RECTANGLE = np.array([[-0.1, -0.05], [0.1, -0.05], [0.1, 0.05], [-0.1, 0.05]])
M = shape_moments.of_polygon(RECTANGLE)
L = interaction(M, facing(M), 1.0)
EVERY = np.ones(6, bool)
FREE = Inverse.of(L, np.ones(4, bool), EVERY, np.ones(6)).free


def tilted(by):
    """A level camera turned about its x axis."""
    pose = Pose(np.diag([1.0, -1.0, -1.0]) @ exp_so3(np.array([by, 0.0, 0.0])), np.zeros(3))
    return Posture(pose, np.zeros(6), np.zeros(0), np.zeros(0), np.zeros(0), np.zeros((6, 0)))


def with_joints(places):
    """A robot whose joints are the camera's own axes, each from -1 to 1."""
    rest, one = posture_of(np.zeros(6)), np.ones(6)
    return Posture(rest.T_base_camera, rest.twist, np.array(places), -one, one, np.eye(6))


def test_what_is_left_free_changes_no_feature_and_has_two_dimensions():
    np.testing.assert_allclose(L @ FREE, 0.0, atol=1e-12)
    np.testing.assert_allclose(FREE @ FREE, FREE, atol=1e-12)
    assert np.trace(FREE) == pytest.approx(2.0)
    four = np.array([True, True, True, False, False, True])
    masked = Inverse.of(L, np.ones(4, bool), four, np.ones(6))
    np.testing.assert_allclose(masked.free, 0.0, atol=1e-12)
    np.testing.assert_array_equal(masked.pseudo[3:5], 0.0)


def test_a_weight_of_zero_is_a_mask():
    weights = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 1.0])
    four = weights > 0
    zeroed = Inverse.of(L, np.ones(4, bool), EVERY, weights).pseudo
    masked = Inverse.of(L, np.ones(4, bool), four, np.ones(6)).pseudo
    np.testing.assert_allclose(zeroed, masked, atol=1e-12)


def test_levelling_turns_the_optical_axis_down():
    twist, h = twist_of(("level",), tilted(0.2)), 1e-4
    np.testing.assert_allclose(twist, [0, 0, 0, -np.sin(0.2), 0, 0], atol=1e-12)
    turned = tilted(0.2).T_base_camera.rotation @ exp_so3(h * twist[3:])
    assert turned[2, 2] < tilted(0.2).T_base_camera.rotation[2, 2]  # further down
    assert (FREE @ twist)[3] == pytest.approx(-0.5 * np.sin(0.2), rel=0.01)  # half is free


def test_joints_go_to_their_middles_or_only_away_from_limits():
    posture = with_joints([0.0, 0.0, 0.0, 0.5, -0.9, 0.0])
    np.testing.assert_allclose(twist_of(("centre",), posture), [0, 0, 0, -0.5, 0.9, 0])
    np.testing.assert_allclose(twist_of(("avoid_limits",), posture), [0, 0, 0, 0, 0.9 - FAR, 0])
    both = twist_of(("centre", "avoid_limits"), posture)
    np.testing.assert_allclose(both, [0, 0, 0, -0.5, 1.8 - FAR, 0])


def test_a_joint_without_limits_has_no_middle():
    posture = with_joints([0.5] * 6)
    posture.lower[0], posture.upper[1] = -np.inf, np.inf
    np.testing.assert_allclose(twist_of(("centre",), posture), [0, 0, -0.5, -0.5, -0.5, -0.5])


def test_speed_and_acceleration_are_limited_and_the_direction_stays():
    limits, wanted, before = Limits(0.4, 99.0, 0.6, 99.0), np.array([0.8, 0.6, 0, 0, 0, 1.0]), 0.0
    for k in range(1, 40):
        twist, changed = limits.apply(wanted, DT)
        assert changed
        np.testing.assert_allclose(twist, wanted * np.linalg.norm(twist[:3]), atol=1e-12)
        assert np.linalg.norm(twist[:3]) == pytest.approx(min(0.6 * DT * k, 0.4))
        assert np.linalg.norm(twist[:3]) >= before
        before = np.linalg.norm(twist[:3]) - 1e-12
    slow, changed = limits.apply(twist, DT)
    assert not changed
    np.testing.assert_array_equal(slow, twist)


def test_a_turn_alone_may_be_what_is_too_quick():
    twist, changed = Limits(9.0, 9.0, None, 3.0).apply(np.array([0.3, 0, 0, 0, 0, 1.0]), DT)
    assert changed
    np.testing.assert_allclose(twist, np.array([0.3, 0, 0, 0, 0, 1.0]) * 3.0 * DT)


def test_it_coasts_holds_and_searches_in_this_order_and_forgets_when_it_sees():
    loss = TargetLoss(coast=0.1, hold=0.1, speed=0.05)
    modes = [loss.wait(DT) for _ in range(12)]
    assert modes == [Mode.COASTING] * 3 + [Mode.HOLDING] * 3 + [Mode.SEARCHING] * 6
    assert np.linalg.norm(loss.search(DT)) == pytest.approx(0.05)
    assert loss.seen() is Mode.SERVOING
    assert loss.wait(DT) is Mode.COASTING
    never = TargetLoss(coast=0.1, hold=None, speed=0.05)
    assert [never.wait(DT) for _ in range(300)][-1] is Mode.HOLDING


def test_the_search_is_a_spiral_that_ends():
    loss, place, places = TargetLoss(coast=0.0, hold=0.0, speed=0.5), np.zeros(2), []
    while loss.wait(DT) is Mode.SEARCHING:
        place = place + DT * loss.search(DT)[:2]
        places.append(place)
    assert np.linalg.norm(places, axis=1).max() == pytest.approx(0.6, abs=0.03)
    # Windings 0.12 m apart: the way is pi r^2 / 0.12 long.
    length = sum(np.linalg.norm(np.diff(places, axis=0), axis=1))
    assert length == pytest.approx(np.pi * 0.6**2 / 0.12, rel=0.05)
