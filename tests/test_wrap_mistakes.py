"""What a wrapped tracker returns or lacks is refused in a sentence that names it."""

import threading
import time

import numpy as np
import pytest
from followed import Moving, follow

from tracking import wrap


def answering(answer):
    class Answering(Moving):
        def update(self, _image):
            return answer

    return wrap(Answering, name="theirs")()


EXPECTED = (
    "expected a box of left, top, width, height [px] (finite numbers up to 1e+06, with an area, or all zeros: not seen), "
    "(ok, box), or a mapping with some of the keys box, angle, corners, seen, confidence"
)


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        (None, f"answered None; {EXPECTED}"),
        ((1, 2, 3), f"answered (1, 2, 3); {EXPECTED}"),
        ((1, 2, 3, 4, 5), f"answered (1, 2, 3, 4, 5); {EXPECTED}"),
        (True, f"answered True; {EXPECTED}"),
        ("box", f"answered 'box'; {EXPECTED}"),
        ((True, None), f"answered (True, None); {EXPECTED}"),
        ((True, (1, 2, 3)), f"answered (True, (1, 2, 3)); {EXPECTED}"),
        (([1, 2, 3, 4], 0.9), f"answered ([1, 2, 3, 4], 0.9); {EXPECTED}"),
        ((float("nan"), 2, 3, 4), f"answered (nan, 2, 3, 4); {EXPECTED}"),
        ((1, 2, float("inf"), 4), f"answered (1, 2, inf, 4); {EXPECTED}"),
        ((1, 2, 1e9, 4), f"answered (1, 2, 1000000000.0, 4); {EXPECTED}"),
        ((1, 2, -3, 4), f"answered (1, 2, -3, 4); {EXPECTED}"),
        ((True, (1, 2, 0, 4)), f"answered (True, (1, 2, 0, 4)); {EXPECTED}"),
        (np.ones((1, 4)), f"answered array([[1., 1., 1., 1.]]); {EXPECTED}"),
        ([True, True, True, True], f"answered [True, True, True, True]; {EXPECTED}"),
    ],
    ids=str,
)
def test_what_is_no_box_is_refused_with_what_it_is(answer, message):
    with pytest.raises(ValueError) as refused:
        follow(answering(answer))
    assert str(refused.value) == f"theirs {message}"


BOX = "it must be left, top, width, height [px] with an area, unless 'seen' is false"
POINTS = "it must be four points [x, y] [px] that go around a convex region"


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        ({"box": 1}, f"theirs: 'box' is 1; {BOX}"),
        ({}, f"theirs: 'box' is missing; {BOX}"),
        ({"box": (1, 2, 0, 4)}, f"theirs: 'box' is (1, 2, 0, 4); {BOX}"),
        (
            {"bbox": 1},
            "theirs answered with the key 'bbox'; the keys are box, angle, corners, seen, "
            "confidence",
        ),
        (
            {"box": (1, 2, 3, 4), "angle": "x"},
            "theirs: 'angle' is 'x'; it must be a number from -1e+06 to 1e+06 [rad]",
        ),
        (
            {"box": (1, 2, 3, 4), "angle": 1e9},
            "theirs: 'angle' is 1000000000.0; it must be a number from -1e+06 to 1e+06 [rad]",
        ),
        ({"box": (1, 2, 3, 4), "seen": 1}, "theirs: 'seen' is 1; it must be true or false"),
        (
            {"corners": [[0, 0], [1, 1], [1, 0], [0, 1]]},
            f"theirs: 'corners' is [[0, 0], [1, 1], [1, 0], [0, 1]]; {POINTS}",
        ),
        ({"corners": "abcd"}, f"theirs: 'corners' is 'abcd'; {POINTS}"),
        (
            {"box": (1, 2, 3, 4), "confidence": 2},
            "theirs: the confidence is 2; it must be from 0 to 1",
        ),
    ],
    ids=str,
)
def test_a_mapping_that_cannot_be_is_refused_by_its_key(answer, message):
    with pytest.raises(ValueError) as refused:
        follow(answering(answer))
    assert str(refused.value) == message


@pytest.mark.parametrize("sure", [None, "high", float("nan"), 7.3, -1, True])
def test_what_is_no_confidence_is_refused(sure):
    with pytest.raises(ValueError) as refused:
        follow(wrap(Moving, confidence=lambda tracker: sure, name="theirs")())
    assert str(refused.value) == f"theirs: the confidence is {sure!r}; it must be from 0 to 1"


def test_other_words_than_true_and_false_are_refused():
    with pytest.raises(ValueError) as refused:
        follow(answering(("yes", (1, 2, 3, 4))))
    assert (
        str(refused.value) == "theirs answered (ok, box) with 'yes' as ok; it must be True or False"
    )
    with pytest.raises(ValueError) as refused:
        follow(answering({"box": (1, 2, 3, 4), "corners": [[0, 0], [1, 0], [1, 1], [0, 1]]}))
    assert str(refused.value) == (
        "theirs answered with both 'box' and 'corners'; one of them is expected"
    )


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
            "theirs needs the arguments weights: give wrap a function that needs none, such as "
            "lambda: Tracker(...)",
        ),
        (
            NoUpdate,
            "theirs: NoUpdate lacks init(image, box) or update(image): give it both methods",
        ),
        (dict, "theirs: dict lacks init(image, box) or update(image): give it both methods"),
        (
            Refusing,
            "theirs: init refused the region x, y, width, height = (40, 30, 30, 20): give another region",
        ),
    ],
)
def test_what_is_no_tracker_is_refused(kind, message):
    with pytest.raises(ValueError) as refused:
        follow(wrap(kind, name="theirs")())
    assert str(refused.value) == message


def test_a_confidence_that_is_to_judge_must_be_there():
    with pytest.raises(ValueError) as refused:
        follow(wrap(Moving, name="theirs")(least_confidence=0.5))
    assert str(refused.value) == (
        "the tracker reports no confidence, but least_confidence = 0.5 needs one: set least_confidence to 0"
    )


def test_a_convention_or_a_confidence_that_is_not_there_is_refused():
    with pytest.raises(ValueError) as refused:
        wrap(Moving, convention="vot", name="theirs")
    assert (
        str(refused.value)
        == "theirs: there is no convention 'vot' of pictures and boxes; known are opencv, got10k"
    )
    with pytest.raises(ValueError) as refused:
        follow(wrap(Moving, confidence="sure", name="theirs")())
    assert (
        str(refused.value)
        == "theirs has no attribute or method 'sure', but confidence= names it: correct the name"
    )


def test_what_makes_no_tracker_is_refused_at_once():
    with pytest.raises(ValueError) as refused:
        wrap(5)
    assert str(refused.value).startswith(
        "5 is not a tracker: expected a class or object with methods init and update"
    )


class Endless(Moving):
    """Computes for ever from the third picture on."""

    def update(self, image):
        while self.count == 2:
            pass
        return super().update(image)


class Sleeping(Moving):
    """Waits for ever outside Python from the third picture on."""

    def update(self, image):
        if self.count == 2:
            time.sleep(20)
        return super().update(image)


class Loading(Moving):
    """Never ends loading."""

    def __init__(self):
        time.sleep(20)


class Learning(Moving):
    """Never ends learning the target."""

    def init(self, image, rect):
        time.sleep(20)


@pytest.mark.parametrize(
    ("made", "limit"),
    [(Endless, "timeout"), (Sleeping, "timeout"), (Loading, "loading"), (Learning, "loading")],
)
def test_a_class_that_never_answers_ends_in_a_sentence(made, limit):
    config = wrap(made, name="theirs")(**{limit: 0.1})
    with pytest.raises(ValueError) as late:
        follow(config)
    assert str(late.value) == (
        f"theirs did not answer within 0.1 s: correct the tracker, or set a longer tracker.{limit}"
    )


def test_a_loop_in_python_is_stopped_and_threads_end_with_their_trackers():
    with pytest.raises(ValueError, match=r"within 0\.1 s"):
        follow(wrap(Endless, name="endless")(timeout=0.1))
    follow(wrap(Moving, name="moving")())
    until = time.monotonic() + 20
    while {"endless", "moving"} & {thread.name for thread in threading.enumerate()}:
        assert time.monotonic() < until
        time.sleep(0.01)


def test_what_a_class_raises_comes_as_it_is():
    class Stops(Moving):
        def update(self, _image):
            raise SystemExit(3)

    with pytest.raises(SystemExit) as stopped:
        follow(wrap(Stops)())
    assert stopped.value.code == 3
