"""Messages, pictures and regions of the TraX protocol come back as they were sent."""

import base64

import numpy as np
import pytest
from followed import frame
from hypothesis import given
from hypothesis import strategies as st

from tracking.guests import trax_messages as messages
from tracking.guests.trax_messages import Message
from tracking.types import Region, State

TEXTS = st.text(st.characters(blacklist_categories=["Cs"], blacklist_characters="\r"))


@given(st.lists(TEXTS, max_size=3), st.dictionaries(st.text("aZ._9", min_size=1), TEXTS))
def test_a_message_is_read_as_it_was_written(texts, named):
    arguments = [f"/{text}" for text in texts]  # with a slash it is no key
    sent = Message("state", arguments, named)
    assert messages.message_in(sent.line()) == sent


def test_other_lines_are_no_messages():
    for line in ("loading", "@@TRAX:dance", " @@TRAX:state", "@@TRAX", ""):
        assert messages.message_in(line) is None
    assert messages.message_in("@@TRAX:status 1,2,3,4 x.y=z\r\n") == Message(
        "state", ["1,2,3,4"], {"x.y": "z"}
    )


def test_quotes_that_are_not_closed_take_no_time():
    """With nested repetitions, 30 letters took minutes."""
    word = '"' + "a" * 100_000
    assert messages.message_in(f"@@TRAX:state {word}") == Message("state", [word])


@pytest.mark.parametrize("picture", [["path"], ["memory"], ["buffer"], ["data"]])
def test_a_picture_comes_back_as_it_was(picture, tmp_path):
    image = frame(0).image
    text = messages.picture_text(image, picture, tmp_path / "a b.png")
    np.testing.assert_array_equal(messages.picture_in(text), image)


def raw(size, pixels):
    return f"image:{size};{base64.b64encode(pixels.tobytes()).decode()}"


def test_grey_pictures_become_rgb():
    grey = np.arange(250, 256, dtype=np.uint8).reshape(2, 3)
    expected = np.dstack([grey] * 3)
    np.testing.assert_array_equal(messages.picture_in(raw("3;2;gray8", grey)), expected)
    deep = grey.astype("<u2") * 256 + 7
    np.testing.assert_array_equal(messages.picture_in(raw("3;2;gray16", deep)), expected)


COLOURS = np.zeros((100, 160, 3), np.uint8)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("image:4000;4000;rgb;!!!!", "Only base64 data is allowed"),
        ("image:4000;4000;rgb;", "cannot reshape array of size 0 into shape (4000,4000,3)"),
        ("image:3;2;rgb;AAAA", "cannot reshape array of size 3 into shape (2,3,3)"),
        (raw("160;100;rgb", COLOURS[..., 0]), "cannot reshape array of size 16000 into shape"),
        (raw("160;100;rgb", COLOURS[..., :2]), "cannot reshape array of size 32000 into shape"),
        (raw("160;100;gray8", COLOURS), "cannot reshape array of size 48000 into shape"),
        (raw("160;100;bgr", COLOURS), "the format 'bgr' is unknown; known are rgb, gray8, gray16"),
        (
            raw("-1;100;rgb", COLOURS),
            "the picture has -1 x 100 px; both sides should be 1 to 16384 px",
        ),
        ("image:0;0;rgb;", "the picture has 0 x 0 px"),
        ("image:1", "not enough values to unpack"),
        ("image:a;b;rgb;AAAA", "invalid literal for int"),
        ("data:image/png;AAAA", "this picture cannot be decoded; known formats are"),
        ("data:image/png;base64;!!!!", "Only base64 data is allowed"),
        ("data:image/png;base64,", "this picture cannot be decoded"),
    ],
)
def test_a_picture_that_is_none_is_refused(text, why):
    with pytest.raises(ValueError, match=r"^the picture .*\.\.\. cannot be decoded: ") as refused:
        messages.picture_in(text)
    assert why in str(refused.value)


@pytest.mark.parametrize(
    ("text", "region"),
    [
        ("1,2,3,4", [1, 2, 3, 4]),
        ("0,0,1,0,1,1", [[0, 0], [1, 0], [1, 1]]),
        ("0", None),
        ("0,0,0,0", None),
        (messages.region_text(np.array([1.5, 2, 3, 4])), [1.5, 2, 3, 4]),
    ],
)
def test_a_region_is_a_box_a_polygon_or_nothing(text, region):
    found = messages.region_in(text)
    assert found is None if region is None else found.tolist() == region


@pytest.mark.parametrize(
    "text",
    ["", "a", "1,2,3", "1,2,3,4,5", "1,2", "1,,2,3", "nan,1,2,3", "1,2,inf,4", "1,2,3,4,5,nan"],
)
def test_what_is_no_region_is_refused(text):
    with pytest.raises(
        ValueError, match=r"^a region of TraX should be a rectangle, a polygon or a mask$"
    ):
        messages.region_in(text)


def test_a_mask_is_a_part_of_the_picture_with_runs_of_zeros_and_ones():
    assert messages.region_in("m3,5,4,3,5,2,5").tolist() == [4, 6, 2, 1]
    assert messages.region_in("m3,5,4,3,2,3").tolist() == [3, 5, 4, 2]  # over the end of a row
    assert messages.region_in("m3,5,4,3,12") is None
    corners = Region(7.0, 4.0).corners(State(20.5, 11.0))
    text = messages.mask_text(corners, np.zeros((30, 40, 3), np.uint8))
    assert messages.region_in(text).tolist() == [17, 9, 7, 4]
