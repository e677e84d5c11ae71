import numpy as np
import pytest

from sim.types import Frame
from tracking.evaluation.track_measures import turned_overlaps
from tracking.types import Region, State, check_region

FRAME = Frame(np.zeros((100, 200, 3), np.uint8), 0.0, 0)


def test_corners_of_a_straight_region_go_around_from_top_left():
    corners = Region(40.0, 20.0).corners(State(100.0, 50.0))
    np.testing.assert_allclose(corners, [[80, 40], [120, 40], [120, 60], [80, 60]])


def test_a_quarter_turn_takes_plus_x_to_plus_y():
    corners = Region(40.0, 20.0).corners(State(100.0, 50.0, np.pi / 2, 2.0))
    np.testing.assert_allclose(corners[1], [120, 90], atol=1e-12)


def test_state_vector_round_trip():
    state = State(1.0, 2.0, -7.0, 0.3)
    np.testing.assert_allclose(State.of(state.vector).vector, state.vector)


@pytest.mark.parametrize(
    ("other", "iou"),
    [
        (State(100.0, 50.0), 1.0),
        (State(120.0, 50.0), 1 / 3),
        (State(100.0, 50.0, np.pi / 2), 1 / 3),
        (State(10.0, 10.0), 0.0),
        (State(100.0, 50.0, 0.0, 0.5), 0.25),
    ],
)
def test_iou_of_rotated_rectangles(other, iou):
    a, b = (Region(40.0, 20.0).corners(s)[None] for s in (State(100.0, 50.0), other))
    assert turned_overlaps(a, b) == pytest.approx(iou, abs=1e-6)


def test_an_empty_region_is_refused():
    with pytest.raises(ValueError) as refused:
        check_region(FRAME, Region(0.0, 20.0), State(100.0, 50.0))
    assert str(refused.value) == "the region is 0 x 20 px; both sides must be at least 4 px"


def test_a_region_mostly_outside_the_image_is_refused():
    with pytest.raises(ValueError) as refused:
        check_region(FRAME, Region(40.0, 20.0), State(201.0, 50.0))
    assert str(refused.value) == (
        "the region spans 181..221 x 40..60 px; most of it must be inside the image of 200 x 100 px"
    )


def test_a_region_that_only_juts_out_is_accepted():
    assert check_region(FRAME, Region(40.0, 20.0), State(199.0, 50.0)) is None
