"""Settings of parts that are made in Python: wrong ones are a sentence, not a crash."""

import numpy as np
import pytest

import servo
from servo.controllers import ibvs
from servo.mistake import Mistake
from sim.types import Frame
from tracking.trackers import frozen, pf_ssd
from tracking.types import Region, State


@pytest.mark.parametrize(
    ("setting", "value", "reason"),
    [
        ("levels", 0, "Input should be greater than or equal to 2"),  # it ended the process
        ("particles", -5, "Input should be greater than or equal to 1"),
        ("noise", float("nan"), "Input should be less than or equal to 10"),
        ("combine", "max", "Input should be 'mean' or 'sum'"),
    ],
)
def test_a_setting_out_of_range_is_named(setting, value, reason):
    with pytest.raises(ValueError) as refused:
        servo.create("pf_ssd", **{setting: value})
    sentence = f"{setting} = {value!r}: {reason}"
    assert str(refused.value) == f"pf_ssd.{sentence}"
    with pytest.raises(Mistake) as refused:
        servo.load("still", tracker=pf_ssd.Config(**{setting: value}))
    assert str(refused.value) == f"tracker: tracker.{sentence}"


def test_a_law_with_a_wrong_gain_is_refused():
    with pytest.raises(Mistake, match=r"controller\.gain = -3: Input should be greater than"):
        servo.load("still", controller=ibvs.Config(gain=-3))


def test_a_region_of_texts_is_one_sentence():
    frame = Frame(np.zeros((120, 160, 3), np.uint8), 0.0, 0)
    with pytest.raises(ValueError) as refused:
        frozen.Config().build(np.random.default_rng(0)).start(
            frame, Region("40", "30"), State(80, 60)
        )
    assert str(refused.value) == (
        "the region's width, height, x, y, theta are '40', '30', 80, 60, 0.0: expected numbers from -1e+06 to 1e+06"
    )


def test_frames_and_films_that_cannot_be_are_sentences():
    run = servo.simulate("still", ["run.duration=0.1"])
    with pytest.raises(Mistake) as refused:
        run.frame("x")
    assert str(refused.value) == "frame(time): expected 1 finite numbers, got ('x',)"
    with pytest.raises(Mistake) as refused:
        servo.result.Clip(b"").save("/no/film.mp4")
    assert (
        str(refused.value)
        == "/no/film.mp4: cannot write this film: No such file or directory; choose another place"
    )
