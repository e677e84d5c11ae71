"""What a wrapped tracker returns or lacks is refused in a sentence that names it."""

import numpy as np
import pytest
from followed import Moving, follow

from tracking import wrap


def answering(answer):
    class Answering(Moving):
        def update(self, _image):
            return answer

    return wrap(Answering, name="theirs")()


EXPECTED = "expected (ok, box) or a box of x, y, width, height with an area"


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        (None, f"update returned None; {EXPECTED}"),
        ((1, 2, 3), f"update returned (1, 2, 3); {EXPECTED}"),
        ((1, 2, 3, 4, 5), f"update returned (1, 2, 3, 4, 5); {EXPECTED}"),
        (True, f"update returned True; {EXPECTED}"),
        ("box", f"update returned 'box'; {EXPECTED}"),
        ((True, None), f"update returned (True, None); {EXPECTED}"),
        ((True, (1, 2, 3)), f"update returned (True, (1, 2, 3)); {EXPECTED}"),
        (([1, 2, 3, 4], 0.9), f"update returned ([1, 2, 3, 4], 0.9); {EXPECTED}"),
        ((float("nan"), 2, 3, 4), f"update returned (nan, 2, 3, 4); {EXPECTED}"),
        ((1, 2, float("inf"), 4), f"update returned (1, 2, inf, 4); {EXPECTED}"),
        ((1, 2, 1e9, 4), f"update returned (1, 2, 1000000000.0, 4); {EXPECTED}"),
        ((1, 2, -3, 4), f"update returned (1, 2, -3, 4); {EXPECTED}"),
        ((True, (1, 2, 0, 4)), f"update returned (True, (1, 2, 0, 4)); {EXPECTED}"),
        (np.ones((1, 4)), f"update returned array([[1., 1., 1., 1.]]); {EXPECTED}"),
        ({"box": 1}, f"update returned {{'box': 1}}; {EXPECTED}"),
    ],
    ids=str,
)
def test_what_is_no_box_is_refused_with_what_it_is(answer, message):
    with pytest.raises(ValueError) as refused:
        follow(answering(answer))
    assert str(refused.value) == f"theirs: {message}"


@pytest.mark.parametrize("score", [None, "high", float("nan"), 7.3, -1])
def test_what_is_no_score_is_refused(score):
    with pytest.raises(ValueError) as refused:
        follow(wrap(Moving, score=lambda tracker: score, name="theirs")())
    assert str(refused.value) == (f"theirs: the score is {score!r}: expected a number from 0 to 1")


def test_the_trackers_own_exceptions_are_not_hidden():
    class Failing(Moving):
        def update(self, _image):
            raise KeyError("weights")

    with pytest.raises(KeyError, match="weights"):
        follow(wrap(Failing)())


class Needs:
    def __init__(self, weights, device="cpu"): ...


class NoUpdate:
    def init(self, image, rect): ...


class Refusing(Moving):
    def init(self, _image, _rect):
        return False


@pytest.mark.parametrize(
    ("kind", "message"),
    [
        (
            Needs,
            "theirs needs weights: give wrap a function without arguments, such as "
            "lambda: Tracker(...)",
        ),
        (NoUpdate, "theirs: NoUpdate lacks init(image, box) or update(image)"),
        (dict, "theirs: dict lacks init(image, box) or update(image)"),
        (Refusing, "theirs: init refused the region x, y, width, height = (40, 30, 30, 20)"),
    ],
)
def test_what_is_no_tracker_is_refused(kind, message):
    with pytest.raises(ValueError) as refused:
        follow(wrap(kind, name="theirs")())
    assert str(refused.value) == message


def test_a_score_that_is_to_judge_must_be_there():
    with pytest.raises(ValueError, match='judge="score" needs score='):
        wrap(Moving, judge="score")
    with pytest.raises(ValueError, match='theirs has no score; set judge = "histogram"'):
        follow(wrap(Moving, name="theirs")(judge="score"))


def test_a_convention_or_a_score_that_is_not_there_is_refused():
    with pytest.raises(ValueError) as refused:
        wrap(Moving, convention="vot", name="theirs")
    assert str(refused.value) == "theirs: there is no convention 'vot'; there is opencv, got10k"
    with pytest.raises(ValueError) as refused:
        follow(wrap(Moving, score="sure", name="theirs")())
    assert (
        str(refused.value)
        == "theirs has no attribute or method 'sure', but score= names it as its score"
    )


def test_what_makes_no_tracker_is_refused_at_once():
    with pytest.raises(ValueError) as refused:
        wrap(5)
    assert str(refused.value).startswith("5 is not a tracker: expected methods init and update")
