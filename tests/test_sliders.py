"""`servo.explore`: a widget for each setting, and the run that they ask for."""

import pytest

import servo
from servo.mistake import Mistake


def test_numbers_words_and_flags_have_their_widgets():
    keys = ("controller.gain", "controller.matrix", "camera.width", "controller.kind", "start.x")
    box = servo.explore("turn_150_points", *keys)
    gain, matrix, width, kind, x = box.children[:5]
    assert (gain.value, gain.min, gain.max) == (1.0, 1e-6, 3.0)
    assert (matrix.value, matrix.options) == ("current", ("current", "desired", "mean"))
    assert (width.value, width.max) == (640, 1920)
    assert (kind.value, "qp" in kind.options) == ("ibvs", True)
    assert (x.value, x.min, x.max) == (0.0, -100.0, 100.0)
    assert [child.description for child in box.children[:5]] == list(keys)
    assert {child.style.description_width for child in box.children[:5]} == {"initial"}


def test_the_button_runs_the_scenario_with_what_is_chosen():
    box = servo.explore("still", "run.duration", "controller.gain", "tracker.kind")
    duration, gain, kind, run = box.children[:4]
    duration.value = 0.2
    gain.value = 0.5
    kind.value = "truth"
    assert box.result is None
    run.click()
    assert len(box.result) == 6
    assert box.result.scenario.controller.gain == 0.5
    assert box.result.scenario.settings()["tracker"]["kind"] == "truth"


@pytest.mark.parametrize(
    ("key", "least", "most"),
    [
        ("start.angle_deg", -180, 180),
        ("start.tilt_deg", 0, 85),
        ("believed.cx_shift", -50, 50),
        ("run.latency", 0, 10),
        ("camera.noise", 0, 20),
        ("gain", 1e-6, 3),
    ],
)
def test_a_slider_reaches_what_its_setting_is_about(key, least, most):
    slider = servo.explore("turn_150_points", key).children[0]
    assert (slider.min, slider.max) == (least, most)


@pytest.mark.parametrize(
    ("key", "sentence"),
    [
        ("controller.gian", "explore: there is no setting 'controller.gian'"),
        ("controller.dof", "explore: controller.dof = None is neither a number nor one of some"),
    ],
)
def test_a_setting_that_cannot_be_chosen_is_one_sentence(key, sentence):
    with pytest.raises(Mistake, match=sentence):
        servo.explore("still", key)
