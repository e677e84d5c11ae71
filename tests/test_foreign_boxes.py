"""Boxes and corners of other trackers as states of a region."""

import numpy as np
import pytest

from tracking.guests.placement import Placement
from tracking.guests.report import Report, convex, report_of_box, report_of_corners
from tracking.types import Region, State

REGION, START = Region(40.0, 20.0), State(100.0, 60.0, 0.3, 1.5)
WIDTH, HEIGHT = np.ptp(REGION.corners(START), axis=0)
BOX = np.array([100 - WIDTH / 2, 60 - HEIGHT / 2, WIDTH, HEIGHT])


def placed(gives=None, **more):
    return Placement(REGION, START, gives, **more)


def test_a_box_relative_to_the_first_moves_and_scales():
    place = placed()
    place.follow(report_of_box(BOX))
    np.testing.assert_allclose(place.state.vector, START.vector, atol=1e-6)
    place.follow(report_of_box(np.array([70.0, 30.0, 2 * WIDTH, 4 * HEIGHT])))  # 8 times the area
    assert (place.state.x, place.state.y) == pytest.approx((70 + WIDTH, 30 + 2 * HEIGHT))
    assert place.state.scale == pytest.approx(1.5 * np.sqrt(8))
    assert (place.state.theta, place.turns, place.resizes) == (0.3, False, True)


def test_boxes_are_relative_to_the_one_that_was_given():
    """Of a target partly outside of the picture the tracker is given what is in it."""
    given = np.array([0.0, 45.0, 45.0, 30.0])
    place = Placement(Region(60.0, 30.0), State(15.0, 60.0), given=given)
    place.follow(report_of_box(given))
    assert (place.state.x, place.state.y) == (15.0, 60.0)
    place.follow(report_of_box(np.array([2.0, 45.0, 49.5, 33.0])))
    assert (place.state.x, place.state.scale) == (pytest.approx(19.25), pytest.approx(1.1))


def test_a_turned_box_is_compared_with_the_region_itself():
    place = placed()
    place.follow(report_of_box(np.array([70.0, 45.0, 60.0, 30.0]), 0.3))
    np.testing.assert_allclose(place.state.vector, START.vector, atol=1e-9)
    place.follow(report_of_box(np.array([70.0, 45.0, 120.0, 60.0]), 0.5 - 4 * np.pi))
    assert place.state.theta == pytest.approx(0.5)  # the angle is continuous
    assert place.state.scale == pytest.approx(3.0)
    assert (place.turns, place.resizes) == (True, True)


@pytest.mark.parametrize(
    "order", [np.roll(way, k) for k in range(4) for way in ((0, 1, 2, 3), (3, 2, 1, 0))], ids=str
)
def test_corners_in_any_order_are_those_of_the_region(order):
    place, state = placed(frozenset({"angle", "size"})), State(110.0, 50.0, 0.5, 1.2)
    corners = REGION.corners(state)
    place.follow(Report(corners=corners[order]))
    np.testing.assert_allclose(place.corners, corners)
    np.testing.assert_allclose(place.state.vector, state.vector, atol=1e-9)
    assert place.turns
    assert place.resizes


def test_the_angle_is_continuous_over_several_turns():
    place = placed(sizes=False)
    for k in range(1, 60):
        theta = 0.3 + 0.25 * k
        corners = REGION.corners(State(100.0, 60.0, theta, 1.5))
        place.follow(Report(corners=np.roll(corners, k % 4, axis=0)))
        assert place.state.theta == pytest.approx(theta, abs=1e-9)
    assert place.state.scale == 1.5


def test_upright_corners_are_a_box_and_turn_nothing():
    report = report_of_corners(np.array([[70.0, 40], [130, 40], [130, 60], [70, 60]]))
    assert (report.box.tolist(), report.corners) == ([70, 40, 60, 20], None)
    place = Placement(REGION, State(100.0, 60.0), frozenset({"size"}))
    place.follow(report)
    assert (place.state.theta, place.turns, place.tilts) == (0.0, False, False)
    assert (place.state.x, place.state.y) == (100.0, 50.0)
    assert place.state.scale == pytest.approx(np.sqrt(60 * 20 / (40 * 20)))


def test_a_rectangle_shows_no_tilt_and_another_quadrilateral_does():
    place = placed()
    place.follow(Report(corners=REGION.corners(State(100.0, 60.0, 0.4, 1.5))))
    assert (place.turns, place.tilts) == (True, False)
    place.follow(Report(corners=np.array([[70.0, 40], [130, 45], [130, 60], [70, 60]])))
    assert place.tilts


def test_only_a_convex_quadrilateral_is_one():
    square = np.array([[0.0, 0], [10, 0], [10, 10], [0, 10]])
    assert convex(square)
    assert convex(square[::-1])
    assert not convex(square[[0, 2, 1, 3]])  # it crosses itself
    assert not convex(np.array([[0.0, 0], [10, 0], [2, 2], [0, 10]]))
    assert not convex(np.zeros((4, 2)))


def test_what_is_not_declared_is_not_followed():
    """An angle that was reported, but not declared; and one that was declared, but not reported."""
    turned = State(110.0, 50.0, 0.9, 2.0)
    for report in (
        report_of_box(np.array([70.0, 30.0, 80.0, 40.0]), 0.9),
        Report(corners=REGION.corners(turned)),
    ):
        place = placed(frozenset({"size"}))
        place.follow(report)
        assert (place.state.x, place.state.y) == pytest.approx((110.0, 50.0))
        assert (place.state.theta, place.turns, place.resizes) == (0.3, False, True)
        assert place.state.scale == pytest.approx(2.0)
    place = placed(frozenset({"angle"}))
    place.follow(report_of_box(BOX))
    assert (place.state.theta, place.state.scale) == (0.3, 1.5)
    assert (place.turns, place.resizes) == (False, False)
