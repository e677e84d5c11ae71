"""Each limit of readers and trackers: the last value that passes, and the first that does not."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from sim.files import reading
from sim.files.picture_file import check_size
from sim.types import Frame
from tracking.appearance.bins import Window
from tracking.drawing import contact_sheet
from tracking.evaluation.track_measures import OVERLAPS, Comparison, frames_until_loss, lost_signal
from tracking.loss import FEW, LossJudge, LossLimits
from tracking.sequences import quadrilateral, truth
from tracking.sequences.sequence import source_of
from tracking.sequences.sources import PaintedSource
from tracking.statistics.comparisons import McNemar
from tracking.types import LARGEST_LOG, Region, State, Status, check_region


def passes(check, *arguments):
    """Whether a check lets this pass; it refuses by ValueError."""
    try:
        check(*arguments)
    except ValueError:
        return False
    return True


@pytest.mark.parametrize(
    ("width", "height", "right"),
    [
        (1, 1, True),
        (0, 1, False),
        (1, 0, False),
        (-1, 5, False),
        (16_384, 16_384, True),
        (16_385, 1, False),
        (1, 16_385, False),
    ],
)
def test_sides_of_pictures(width, height, right):
    assert passes(check_size, width, height, "here") is right


@pytest.mark.parametrize(("size", "right"), [(0, True), (9, True), (10, True), (11, False)])
def test_sizes_of_files(tmp_path, size, right):
    (tmp_path / "a").write_bytes(bytes(size))
    assert passes(reading.content, tmp_path / "a", "file", 10) is right


@pytest.mark.parametrize(
    ("line", "right"),
    [
        ("1000000,0,5,5", True),
        ("1000001,0,5,5", False),
        ("0,0,0.001,5", True),
        ("0,0,0,5", False),
        ("0,0,5,0", False),
        ("-1000000,0,5,5", True),
        ("-1000001,0,5,5", False),
    ],
)
def test_numbers_of_truths(tmp_path, line, right):
    (tmp_path / "groundtruth.txt").write_text(f"{line}\n{line}\n")
    assert passes(truth.read, tmp_path / "groundtruth.txt") is right


@pytest.mark.parametrize(
    ("line", "right"),
    [
        ("5,5,6,6", True),
        ("5,5,5,6", False),
        ("5,5,6,5", False),
        ("6,5,5,6", False),
    ],
)
def test_corners_of_truths(tmp_path, line, right):
    (tmp_path / "gt.txt").write_text(f"{line}\n")
    assert passes(truth.read, tmp_path / "gt.txt") is right


@pytest.mark.parametrize(
    ("line", "right"),
    [
        ("10,20,11,21", False),
        ("10,20,10,21", True),
        ("10,20,11,20", True),
    ],
)
def test_four_numbers_are_corners_only_where_both_are_larger(tmp_path, line, right):
    (tmp_path / "any.txt").write_text(f"{line}\n")
    assert passes(truth.read, tmp_path / "any.txt") is right


@pytest.mark.parametrize(
    ("box", "size", "right"),
    [
        ((10, 20, 40, 60), (49, 79), True),  # it ends one pixel beyond the picture
        ((10, 20, 40, 60), (48.9, 79), False),
        ((10, 20, 40, 60), (49, 78.9), False),
        ((10, 20, 40, 60), (39, 59), False),  # as a corner it lies one pixel beyond
        ((10, 20, 40, 60), (38.9, 59), True),
        ((10, 20, 40, 60), (39, 58.9), True),
        ((10, 20, 10, 60), (15, 70), True),
        ((10, 20, 40, 20), (45, 30), True),
        ((-10, 20, 5, 30), (9, 40), False),
        ((-10, 20, 5, 30), (9, 49), True),
    ],
)
def test_boxes_that_leave_the_picture(box, size, right):
    corners = quadrilateral.corners_of(np.array(box, float))[None]
    assert passes(truth.check_boxes, corners, size, "gt") is right
    gone = np.full((1, 4, 2), np.nan)
    assert passes(truth.check_boxes, np.concatenate([gone, corners]), size, "gt") is right


def test_a_turned_target_may_leave_the_picture():
    corners = Region(40.0, 60.0).corners(State(30.0, 50.0, 0.3))[None]
    truth.check_boxes(corners, (45, 70), "gt")


def test_sides_that_only_touch_do_not_cross():
    for touching in ([(0, 0), (10, 0), (5, 0), (0, 10)], [(0, 0), (10, 0), (10, 10), (0, 0)]):
        assert not quadrilateral.crosses_itself(np.array(touching, float))


@pytest.mark.parametrize(("skew", "turned"), [(1.0, True), (1.01, False)])
def test_corners_are_a_rectangle_up_to_a_fiftieth_of_the_longer_side(skew, turned):
    """A target of 50 x 20 px that points down, one of its sides longer by the skew."""
    corners = np.array([[0, 0], [0, 50], [-20, 50], [-20, -skew]])
    region, state = quadrilateral.placement(corners, turned=True)
    assert (region.width == 50.0) is turned
    assert (state.theta == np.pi / 2) is turned


@pytest.mark.parametrize(
    ("text", "right"),
    [
        ("camera:0", True),
        ("camera:999", True),
        ("camera:1000", False),
        ("camera:", False),
        ("camera:-1", False),
    ],
)
def test_numbers_of_cameras(text, right):
    assert passes(source_of, text, 30.0) is right


def region_passes(width=40.0, height=20.0, x=50.0, y=30.0, theta=0.0, scale=1.0, size=(60, 100)):
    frame = Frame(np.broadcast_to(np.uint8(0), (*size, 3)), 0.0, 0)
    return passes(check_region, frame, Region(width, height), State(x, y, theta, scale))


@pytest.mark.parametrize(
    ("given", "right"),
    [
        ({"width": 4.0}, True),
        ({"width": 3.99}, False),
        ({"height": 4.0}, True),
        ({"height": 3.99}, False),
        ({"width": 8.0, "scale": 0.5}, True),
        ({"x": 0.0}, True),
        ({"x": -0.01}, False),
        ({"y": 60.0}, True),
        ({"y": 60.01}, False),
        ({"size": (16_384, 100)}, True),
        ({"size": (16_385, 100)}, False),
        ({"size": (60, 16_384)}, True),
        ({"size": (60, 16_385)}, False),
        ({"theta": 1e6}, True),
        ({"theta": -1.001e6}, False),
        ({"theta": math.nan}, False),
        (
            {
                "width": 1e6,
                "scale": math.exp(-LARGEST_LOG),
                "size": (60, 16_000),
                "x": 8000.0,
                "height": 1000.0,
            },
            True,
        ),
        ({"width": 1e3, "height": 1e3, "scale": 0.99 * math.exp(-LARGEST_LOG)}, False),
        ({"scale": 1.01 * math.exp(LARGEST_LOG), "x": 4e3, "y": 4e3, "size": (8000, 8000)}, False),
        ({"scale": math.exp(LARGEST_LOG), "x": 4e3, "y": 4e3, "size": (8000, 8000)}, True),
    ],
)
def test_regions(given, right):
    assert region_passes(**given) is right


def test_a_window_holds_itself_and_nothing_larger():
    window = Window(3, 4, 10, 12)
    assert window.holds(window)
    for side, further in (("left", -1), ("top", -1), ("right", 1), ("bottom", 1)):
        sides = {"left": 3, "top": 4, "right": 10, "bottom": 12}
        other = Window(**(sides | {side: sides[side] + further}))
        assert other.holds(window)
        assert not window.holds(other)


def judged(*distances, **settings):
    lock = LossJudge(LossLimits(**{"floor": 0.2, "cap": 0.5, "patience": 1.0} | settings))
    return [lock.judge(d, 0.5 * k) for k, d in enumerate(distances)], lock


def test_a_distance_at_the_threshold_is_believed():
    L, U, X = Status.LOCKED, Status.UNSURE, Status.LOST
    assert judged(0.5, np.nextafter(0.5, 1))[0] == [L, U]
    assert judged(0.6, 0.6, 0.6, 0.4)[0] == [U, U, X, L]  # patience: 1 s, hysteresis: 0.8 * 0.5
    assert judged(0.6, np.nextafter(0.4, 1))[0] == [U, U]
    assert judged(*[0.1] * (FEW - 1))[1].threshold == 0.5
    assert judged(*[0.1] * FEW)[1].threshold == 0.2


def test_equal_pairs_count_for_neither():
    test = McNemar.of(np.array([1, 2, 3, 3.0]), np.array([2, 1, 3, 1.0]))
    assert (test.wins, test.losses, test.ties) == (2, 1, 1)


def compared(errors, sizes=(20.0, 20.0), confidence=None):
    """A target of 20 x 20 px, found that many pixels to the right."""
    at = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * sizes
    true = np.stack([at] * len(errors))
    found = true + np.array([[[e, 0]] for e in errors])
    confidence = np.ones(len(errors)) if confidence is None else np.array(confidence)
    track = SimpleNamespace(corners=found, confidence=confidence, states=found[:, 0])
    return Comparison.of(track, true)


def test_a_target_is_away_when_it_is_farther_than_its_size_five_times_in_a_row():
    assert frames_until_loss(compared([0, 21, 21, 21, 21, 0, 21])) == 7
    assert frames_until_loss(compared([0, 0, 21, 21, 21, 21, 21])) == 2
    assert frames_until_loss(compared([0, 0, 20, 21, 21, 21, 21])) == 7


def test_an_overlap_at_a_threshold_is_no_success():
    """Half of the target is a third of the union; a whole one is no more than 1."""
    whole = compared([0.0, 0.0])
    assert whole.success().tolist() == [1.0] * (len(OVERLAPS) - 1) + [0.0]
    assert compared([20.0, 20.0]).success().tolist() == [0.0] * len(OVERLAPS)
    assert compared([20.0, 21.0]).precision()[19:22].tolist() == [0.0, 0.5, 1.0]


def test_a_target_is_lost_below_a_tenth_of_overlap():
    """18 of 22 px away 4 are shared and 40 are covered."""
    assert lost_signal(compared([0, 19], (22.0, 20.0), [0.9, 0.1])) == 1.0
    assert np.isnan(lost_signal(compared([0, 18], (22.0, 20.0), [0.9, 0.1])))


def test_a_sheet_has_no_estimate_where_the_track_has_ended():
    square = np.array([[20, 20], [60, 20], [60, 50], [20, 50]], float)
    truths, source = (
        np.stack([square] * 3),
        PaintedSource(lambda k: np.zeros((90, 120, 3), np.uint8), 3),
    )
    green = []
    for n in (1, 2, 3):
        red, found, _ = np.moveaxis(
            contact_sheet.sheet(source, truths, np.stack([square + 9] * n), count=3), -1, 0
        ).astype(int)
        green.append(np.sum(found > red + 60))
    assert green == pytest.approx([green[0], 2 * green[0], 3 * green[0]], rel=0.01)
    assert green[0] > 20
