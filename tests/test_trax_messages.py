"""Messages, pictures and regions of the TraX protocol come back as they were sent."""

import numpy as np
import pytest
from followed import frame
from hypothesis import given
from hypothesis import strategies as st

from tracking.wrapped import trax_messages as messages
from tracking.wrapped.trax_messages import Message

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
    found = messages.picture_in(text)
    if picture == ["path"]:
        assert found == tmp_path / "a b.png"
    else:
        np.testing.assert_array_equal(found, image)


@pytest.mark.parametrize("text", ["image:3;2;rgb;AAAA", "data:image/png;AAAA", "image:1"])
def test_a_picture_that_is_none_is_refused(text):
    with pytest.raises(ValueError, match=r"the picture .*\.\.\. cannot be decoded"):
        messages.picture_in(text)


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


@pytest.mark.parametrize("text", ["", "a", "1,2,3", "1,2,3,4,5", "1,2", "1,,2,3"])
def test_what_is_no_region_is_refused(text):
    with pytest.raises(ValueError, match=r"^no region$"):
        messages.region_in(text)
