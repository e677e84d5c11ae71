import numpy as np
import pytest

from tracking.sequences import quadrilateral, truth
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
        ("", "this truth has no lines: it needs one for each picture"),
        (
            "1,2,3\n",
            "groundtruth.txt, line 1: the line has 3 numbers: expected 4 of a box, or 8 of four corners; correct the line",
        ),
        (
            "40,30,60,30,70,40,70,50,40,50\n",
            "groundtruth.txt, line 1: the line has 10 numbers: expected 4 of a box, or 8 of four "
            "corners; correct the line",
        ),
        ("1,2,3,4\n1,2,x,4\n", "groundtruth.txt, line 2: '1,2,x,4' is not a line of numbers"),
        ("a,b\n1,2\n", "groundtruth.txt: the columns are a, b; a truth needs x1..y4, or left, top"),
    ],
)
def test_a_file_that_is_no_truth_is_refused(tmp_path, text, message):
    with pytest.raises(ValueError) as refused:
        truth.read(written(tmp_path, text))
    assert message in str(refused.value)


def test_a_truth_of_many_lines_too_many_is_not_parsed(tmp_path):
    path = written(tmp_path, "0\n" * 1_500_000)  # no line of it is one of a truth
    with pytest.raises(ValueError) as refused:
        truth.read(path, count=10)
    assert str(refused.value) == (
        f"{path}: this truth has 1500000 lines for 10 pictures; it needs one for each, with nan "
        "where the target is absent"
    )


def test_placement_is_the_upright_box_or_the_turned_rectangle():
    region, state = Region(40.0, 20.0), State(100.0, 50.0, 0.4)
    corners = region.corners(state)
    turned = quadrilateral.placement(corners, turned=True)
    assert turned[0].width == pytest.approx(40)
    assert turned[1].theta == pytest.approx(0.4)
    upright = quadrilateral.placement(corners)
    assert upright[1].theta == 0.0
    assert upright[0].width == pytest.approx(40 * np.cos(0.4) + 20 * np.sin(0.4))
    trapezium = np.array([[0, 0], [40, 0], [30, 20], [10, 20]], float)
    assert quadrilateral.placement(trapezium, turned=True)[1] == State(20.0, 10.0)


def test_tld_has_two_corners(tmp_path):
    text = "10,20,40,60\nNaN,NaN,NaN,NaN\n"
    for path, form in (
        (written(tmp_path, text, "gt.txt"), truth.Format.AUTO),
        (written(tmp_path, text, "mine.txt"), truth.Format.TLD),
    ):
        found = truth.read(path, form)
        np.testing.assert_array_equal(found[0], BOX)
        assert np.isnan(found[1]).all()


def test_four_numbers_that_may_be_two_corners_are_not_guessed(tmp_path):
    path = written(tmp_path, "10,20,40,60\nnan,nan,nan,nan\n12,20,42,60\n", "mine.txt")
    with pytest.raises(ValueError) as refused:
        truth.read(path)
    assert str(refused.value) == (
        f"{path}: these numbers may be x,y,w,h or x1,y1,x2,y2; give the format of this truth: "
        "otb, vot or tld (--truth-format, or truth_format in a suite or in [recording])"
    )
    box = truth.read(path, truth.Format.VOT)[0]
    np.testing.assert_array_equal(box, [[10, 20], [50, 20], [50, 80], [10, 80]])
    np.testing.assert_array_equal(truth.read(path, truth.Format.OTB)[0], box - 1)


def test_boxes_that_leave_the_picture_but_fit_as_corners_are_not_guessed(tmp_path):
    found = truth.read(written(tmp_path, "10,20,40,60\nnan,nan,nan,nan\n12,20,42,60\n"))
    np.testing.assert_array_equal(found[0], [[10, 20], [50, 20], [50, 80], [10, 80]])
    truth.check_boxes(found, (100, 100), "gt")  # it fits: the name decides
    truth.check_boxes(found, (40, 50), "gt")  # it fits neither way: a target that leaves
    with pytest.raises(ValueError, match=r"^gt: read as x,y,w,h, these numbers place"):
        truth.check_boxes(found, (60, 70), "gt")
    truth.check_boxes(found[:0], (60, 70), "gt")


def test_the_one_number_of_vots_is_an_absent_target(tmp_path):
    found = truth.read(written(tmp_path, "m10,20,3,2,0,6\n0\n0.0\n1,2,3,4\n"))
    assert np.isfinite(found).all(axis=(1, 2)).tolist() == [True, False, False, True]
    with pytest.raises(
        ValueError,
        match="line 2: the line has 1 numbers: expected 4 of a box, or 8 of four corners; correct the line",
    ):
        truth.read(written(tmp_path, "1,2,3,4\n2\n"))


def test_a_box_of_zeros_is_an_absent_target(tmp_path):
    found = truth.read(written(tmp_path, "40,20,30,40\n0,0,0,0\n"))
    assert np.isnan(found[1]).all()


NAME = "groundtruth.txt, line 2"


@pytest.mark.parametrize(
    ("line", "message"),
    [
        (
            "50,20,-30,40",
            f"{NAME}: the target is -30 x 40 px: both sides should be positive; correct that line",
        ),
        (
            "50,20,30,0",
            f"{NAME}: the target is 30 x 0 px: both sides should be positive; correct that line",
        ),
        ("10,5;20,5;30;40", "'10,5;20,5;30;40' is not a line of numbers (if a comma is a"),
        ("10,5 20,5 30,0 40,0", "'10,5 20,5 30,0 40,0' is not a line of numbers (if a comma is a"),
        (
            "10,5,20,5,30,0,40,0",
            f"{NAME}: the corners are not in order around the target: two "
            "sides cross; reorder the corners",
        ),
        (
            "50,20,nan,40",
            "'50,20,nan,40' is not a position in a picture: all numbers must be from -1e+06 to 1e+06, or all",
        ),
        (
            "50,20,inf,40",
            "'50,20,inf,40' is not a position in a picture: all numbers must be from -1e+06 to 1e+06",
        ),
        (
            "",
            f"{NAME}: the line has 0 numbers: expected 4 of a box, or 8 of four corners; correct the line",
        ),
    ],
)
def test_a_line_that_would_be_read_as_something_else_is_refused(tmp_path, line, message):
    with pytest.raises(ValueError) as refused:
        truth.read(written(tmp_path, f"50,20,30,40\n{line}\n50,20,30,40\n"))
    assert message in str(refused.value)


@pytest.mark.parametrize(
    ("text", "form", "message"),
    [
        (
            "50,20,30,40",
            "TLD",
            "line 1: 50,20,30,40 is not x1,y1,x2,y2 with x2 > x1 and y2 > y1: correct that line, "
            "or give the format of this truth: otb, vot or tld (--truth-format, or",
        ),
        (
            "10,20,40,20,40,60,10,60",
            "TLD",
            "line 1: the line has 8 numbers: expected 4, as in format TLD",
        ),
        (
            "10,20,40,20,40,60,10,60",
            "OTB",
            "line 1: the line has 8 numbers: expected 4, as in format OTB",
        ),
        (
            "10,20,40,20",
            "CSV",
            "the columns are 10, 20, 40, 20; a truth needs x1..y4, or left, top",
        ),
        ("x,y,w,h\n1,2", "AUTO", "line 2: the line has 2 columns, but the header has 4; correct "),
        ("x,y,w,h\n1,5,2,5,3,4", "AUTO", "line 2: the line has 6 columns, but the header has 4; "),
        ("x,y,w,h\n1,2,,4", "AUTO", "line 2: '1;2;nan;4' is not a position in a picture"),
        ("x,y,w,h\n1,2,-3,4", "AUTO", "line 2: the target is -3 x 4 px: both sides should be"),
    ],
)
def test_each_format_refuses_what_it_has_not(tmp_path, text, form, message):
    with pytest.raises(ValueError) as refused:
        truth.read(written(tmp_path, text), truth.Format[form])
    assert message in str(refused.value)


def test_a_csv_may_count_its_frames_from_one(tmp_path):
    text = "frame,x,y,w,h\n1,10,20,30,40\n2,10,20,30,40\n"
    np.testing.assert_array_equal(truth.read(written(tmp_path, text)), [BOX, BOX])


@pytest.mark.parametrize(
    ("frames", "message"),
    [
        (
            (0, 1, 10),
            "line 4: the frame is 10, expected 2: sort the lines by their frames, and give ",
        ),
        ((1, 0, 2), "line 3: the frame is 0, expected 2: sort the lines"),
        (("0", "1", "c"), "line 4: the frame is 'c', but should be a number: correct it"),
    ],
)
def test_a_csv_whose_frames_are_not_in_order_is_refused(tmp_path, frames, message):
    lines = [f"{frame},10,20,30,40\n" for frame in frames]
    with pytest.raises(ValueError) as refused:
        truth.read(written(tmp_path, "frame,x,y,w,h\n" + "".join(lines)))
    assert message in str(refused.value)


def test_an_unknown_format_is_refused():
    with pytest.raises(ValueError) as refused:
        truth.Format.named("coco")
    assert str(refused.value) == (
        "there is no truth format 'coco'; there is auto, otb, vot, tld, csv"
    )


@pytest.mark.parametrize(
    ("corners", "crosses"),
    [
        ([(0, 0), (10, 0), (10, 10), (0, 10)], False),
        ([(0, 0), (10, 0), (0, 10), (10, 10)], True),  # the second side crosses the fourth
        ([(0, 0), (10, 10), (10, 0), (0, 10)], True),  # the first side crosses the third
        ([(0, 0), (10, 2), (3, 3), (2, 10)], False),  # hollow
    ],
)
def test_sides_that_cross_are_seen(corners, crosses):
    assert quadrilateral.crosses_itself(np.array(corners, float)) is crosses


def test_lasot_counts_from_one_and_marks_absent_frames(tmp_path):
    path = written(tmp_path, "11,21,30,40\n1,1,-1,-1\n11,21,30,40\n0,0,0,0\n")
    written(tmp_path, "0,1,0,0\n", "full_occlusion.txt")
    written(tmp_path, "0,0,1,0", "out_of_view.txt")
    found = truth.read(path)
    np.testing.assert_array_equal(found[0], BOX)
    assert np.isnan(found[1:]).all()
    place = written(tmp_path, "0,0,1", "out_of_view.txt")
    with pytest.raises(ValueError) as refused:
        truth.read(path)
    assert str(refused.value) == (
        f"{place}: expected 4 numbers 0 or 1, one for each line of groundtruth.txt"
    )


@pytest.mark.parametrize(
    ("line", "box"),
    [
        ("m10,20,5,4,6,3,3,1", [11, 21, 3, 2]),  # 3 pixels, and one below
        ("m10,20,5,4,0,20", [10, 20, 5, 4]),
        ("m10,20,5,4,4,2,14", [10, 20, 5, 2]),  # the last of a row, the first of the next
        ("m10,20,5,4,7,0,2,1", [14, 21, 1, 1]),
        ("m10,20,5,4,20", None),
        ("m0,0,0,0,0", None),
    ],
)
def test_a_mask_of_vot_is_the_box_around_it(tmp_path, line, box):
    found = truth.read(written(tmp_path, f"{line}\n10,20,30,40\n"))
    np.testing.assert_array_equal(found[1], BOX)
    if box is None:
        assert np.isnan(found[0]).all()
    else:
        np.testing.assert_array_equal(found[0], quadrilateral.corners_of(np.array(box, float)))


@pytest.mark.parametrize(
    ("line", "message"),
    [
        (
            "m1,2,x,4",
            "groundtruth.txt, line 1: 'm1,2,x,4' is not a mask of VOT: after the m it should have "
            "x, y, width, height and the lengths of runs, all whole numbers separated by commas, "
            "such as m10,20,3,2,0,6",
        ),
        (
            "m1,2,3,4,5,9",
            "groundtruth.txt, line 1: the runs of this mask have 14 pixels, but its "
            "rectangle only 12; correct that line",
        ),
        (
            "m1,2,3,4,5,-9",
            "groundtruth.txt, line 1: 'm1,2,3,4,5,-9' is not a mask in a picture: a "
            "number is negative or too large; correct that line",
        ),
        (
            "m1,2,1000001,4",
            "groundtruth.txt, line 1: 'm1,2,1000001,4' is not a mask in a picture: a "
            "number is negative or too large; correct that line",
        ),
    ],
)
def test_a_mask_that_is_none_is_refused(tmp_path, line, message):
    with pytest.raises(ValueError) as refused:
        truth.read(written(tmp_path, line))
    assert str(refused.value) == message


def test_frames_that_got10k_marks_absent_have_no_target(tmp_path):
    lines = "11,21,5,6\n-1,-1,-1,-1\n12,22,5,6\n"
    path = written(tmp_path, lines, "groundtruth.txt")
    written(tmp_path, "x", "meta_info.ini")
    written(tmp_path, "0\n1\n1\n", "absence.label")
    found = truth.read(path)
    assert found[0, 0].tolist() == [10, 20]
    assert np.isnan(found[1:]).all()
    written(tmp_path, "0\n1\n", "absence.label")
    with pytest.raises(
        ValueError, match=r"absence\.label: expected 3 numbers 0 or 1, one for each"
    ):
        truth.read(path)
