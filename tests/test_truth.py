import numpy as np
import pytest

from tracking.evaluation import truth
from tracking.types import Region, State

BOX = [[10, 20], [40, 20], [40, 60], [10, 60]]


def written(tmp_path, text, name="groundtruth.txt"):
    path = tmp_path / name
    path.write_text(text)
    return path


@pytest.mark.parametrize("line", ["11,21,30,40", "11\t21\t30\t40", "11 21 30 40", "11, 21, 30, 40"])
def test_otb_counts_pixels_from_one(tmp_path, line):
    found = truth.read(written(tmp_path, f"{line}\n{line}\n\n", "groundtruth_rect.2.txt"))
    np.testing.assert_array_equal(found, [BOX, BOX])


def test_vot_has_four_or_eight_numbers_and_nan_where_the_target_is_absent(tmp_path):
    text = "10,20,30,40\n10,20,40,20,40,60,10,60\nnan,nan,nan,nan\n"
    found = truth.read(written(tmp_path, text))
    np.testing.assert_array_equal(found[:2], [BOX, BOX])
    assert np.isnan(found[2]).all()


@pytest.mark.parametrize(
    "text",
    [
        "frame,left,top,width,height\n0,10,20,30,40\n1,,,,\n",
        "x,y,w,h\n10,20,30,40\nnan,nan,nan,nan\n",
        "x1,y1,x2,y2,x3,y3,x4,y4,note\n10,20,40,20,40,60,10,60,a\n,,,,,,,,b\n",
    ],
)
def test_csv_is_read_by_its_header(tmp_path, text):
    found = truth.read(written(tmp_path, text, "mine.csv"))
    np.testing.assert_array_equal(found[0], BOX)
    assert np.isnan(found[1]).all()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "this truth is empty"),
        ("1,2,3\n", "groundtruth.txt, line 1: a line has 4 or 8 numbers, not 3"),
        ("1,2,3,4\n1,2,x,4\n", "groundtruth.txt, line 2: '1,2,x,4' is not a line of numbers"),
        ("a,b\n1,2\n", "groundtruth.txt: the columns are a, b; it needs x1..y4, or left, top"),
    ],
)
def test_a_file_that_is_no_truth_is_refused(tmp_path, text, message):
    with pytest.raises(ValueError) as refused:
        truth.read(written(tmp_path, text))
    assert message in str(refused.value)


def test_placement_is_the_upright_box_or_the_turned_rectangle():
    region, state = Region(40.0, 20.0), State(100.0, 50.0, 0.4)
    corners = region.corners(state)
    turned = truth.placement(corners, turned=True)
    assert turned[0].width == pytest.approx(40)
    assert turned[1].theta == pytest.approx(0.4)
    upright = truth.placement(corners)
    assert upright[1].theta == 0.0
    assert upright[0].width == pytest.approx(40 * np.cos(0.4) + 20 * np.sin(0.4))
    trapezium = np.array([[0, 0], [40, 0], [30, 20], [10, 20]], float)
    assert truth.placement(trapezium, turned=True)[1] == State(20.0, 10.0)
