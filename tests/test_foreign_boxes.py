"""Boxes and corners of other trackers as states of a region."""

import numpy as np
import pytest

from tracking.types import Region, State
from tracking.wrapped.boxes import convex
from tracking.wrapped.foreign_tracker import Placement

REGION, START = Region(40.0, 20.0), State(100.0, 60.0, 0.3, 1.5)
BOX = np.array([60.0, 30.0, 80.0, 60.0])


def placed(sizes=True):
    return Placement(REGION, START, BOX, sizes=sizes)


def test_a_box_relative_to_the_first_moves_and_scales():
    place = placed()
    place.follow_box(BOX)
    assert place.state == START
    place.follow_box(np.array([70.0, 30.0, 160.0, 240.0]))  # eight times the area
    assert (place.state.x, place.state.y) == pytest.approx((150.0, 150.0))
    assert place.state.scale == pytest.approx(1.5 * np.sqrt(8))
    assert (place.state.theta, place.turns, place.resizes) == (0.3, False, True)


@pytest.mark.parametrize(
    "order", [np.roll(way, k) for k in range(4) for way in ((0, 1, 2, 3), (3, 2, 1, 0))], ids=str
)
def test_corners_in_any_order_are_those_of_the_region(order):
    place, state = placed(), State(110.0, 50.0, 0.5, 1.2)
    corners = REGION.corners(state)
    np.testing.assert_allclose(place.follow_corners(corners[order]), corners)
    np.testing.assert_allclose(place.state.vector, state.vector, atol=1e-9)
    assert place.turns
    assert place.resizes


def test_the_angle_is_continuous_over_several_turns():
    place = placed(sizes=False)
    for k in range(1, 60):
        theta = 0.3 + 0.25 * k
        corners = REGION.corners(State(100.0, 60.0, theta, 1.5))
        place.follow_corners(np.roll(corners, k % 4, axis=0))
        assert place.state.theta == pytest.approx(theta, abs=1e-9)
    assert place.state.scale == 1.5


def test_upright_corners_turn_nothing():
    place = Placement(REGION, State(100.0, 60.0), BOX, sizes=True)
    place.follow_corners(np.array([[70.0, 40], [130, 40], [130, 60], [70, 60]]))
    assert (place.state.theta, place.turns) == (0.0, False)
    assert place.state.scale == pytest.approx((20 * 30 + 10 * 10) / (20**2 + 10**2))


def test_only_a_convex_quadrilateral_is_one():
    square = np.array([[0.0, 0], [10, 0], [10, 10], [0, 10]])
    assert convex(square)
    assert convex(square[::-1])
    assert not convex(square[[0, 2, 1, 3]])  # it crosses itself
    assert not convex(np.array([[0.0, 0], [10, 0], [2, 2], [0, 10]]))
    assert not convex(np.zeros((4, 2)))
