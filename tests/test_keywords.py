"""Settings given from Python as keywords."""

from dataclasses import dataclass

import numpy as np
import pytest

import servo
from servo import Mistake


class Mine:
    """A tracker of one's own."""

    def init(self, image, rect):
        self.rect = rect

    def update(self, image):
        return True, self.rect


def test_keywords_are_the_changes_of_the_command_line():
    given = servo.load(
        "reversal",
        ["run.latency=2"],
        seed=3,
        gain=1.5,
        tracker="kams",
        camera={"noise": np.float64(4)},
        dof=("vx", "vy"),
        **{"start.x": np.int64(5)},
    )
    texts = [
        "run.latency=2",
        "controller.gain=1.5",
        "tracker.kind=kams",
        "camera.noise=4.0",
        'controller.dof=["vx", "vy"]',
        "start.x=5",
    ]
    assert given.settings() == servo.load("reversal", texts, seed=3).settings()


def test_a_kind_comes_before_the_settings_that_only_it_has():
    assert servo.load("still", margin=20.0, controller="qp").controller.margin == 20.0
    table = {"file": "duck", "kind": "mesh"}
    assert servo.load("still", target=table).target.file == "duck"


def test_draws_and_bounds_are_tables_like_others():
    wide = {"start.x": {"uniform": [-30, 30]}}
    assert abs(servo.load("still", seed=1, vary=wide).start.x) <= 30
    assert servo.load("still", seed=1, vary={}).drawn == {}
    assert servo.load("still", expect={"servo_rms_px": 1}).expect["servo_rms_px"] == 1


def test_a_part_of_ones_own_goes_with_settings():
    scenario = servo.load("still", tracker=Mine, gain=1.0)
    assert scenario.controller.gain == 1.0
    assert scenario.expect == {"outcome": "CONVERGED", "servo_rms_px": 4.0}
    assert "Mine" in str(scenario.settings()["tracker"]["kind"])


@dataclass(frozen=True)
class Law:
    """A control law of one's own, and the setting of it."""

    gain: float = 1.0

    def build(self, rng):
        return self


@pytest.mark.parametrize(
    ("part", "changes", "given"),
    [
        (Law, [], {"gain": 2}),
        (Law, ["controller.gain=2"], {}),
        (Law(3.0), ["controller.gain=2"], {}),
        (Law(2.0), [], {}),
        (Law, [], {"controller.gain": 2}),
    ],
)
def test_settings_reach_a_part_of_ones_own(part, changes, given):
    scenario = servo.load("still", changes, seed=3, controller=part, **given)
    assert scenario.controller == Law(2.0)
    assert scenario.run.seed == 3
    assert scenario.settings()["controller"] == {"kind": f"{__name__}:Law", "gain": 2.0}


@dataclass(frozen=True)
class Named(Law):
    """A part with a field that has the name of the kind."""

    kind: str = "mine"


def test_a_field_called_kind_does_not_rename_a_part():
    scenario = servo.load("still", controller=Named, gain=2)
    assert scenario.controller == Named(2.0)
    assert scenario.settings()["controller"] == {"kind": f"{__name__}:Named", "gain": 2.0}


def test_a_draw_reaches_a_part_of_ones_own_and_an_instance_is_left_as_it_is():
    law = Law()
    drawn = servo.load("still", seed=1, controller=law, vary={"controller.gain": {"choice": [7.0]}})
    assert (drawn.controller, law) == (Law(7.0), Law())


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"gain": "x"}, "gain='x': controller.gain = 'x': input should be a valid number"),
        ({"gian": 1}, "there is no setting 'gian'; did you mean 'gain'?"),
        (
            {"coast": 1.0},
            "there is no setting 'coast'; did you mean 'contrast'?",
        ),  # of the law that it replaces
        (
            {"overrides": ["controller.coast=1"]},
            "--set controller.coast=1: controller: there is no key 'coast'; there is gain",
        ),
    ],
)
def test_a_setting_that_a_part_of_ones_own_lacks_is_refused(given, message):
    with pytest.raises(Mistake) as found:
        servo.load("still", controller=Law, **given)
    assert str(found.value) == message


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"gian": 1.0}, "there is no setting 'gian'; did you mean 'gain'?"),
        (
            {"qqqqqq": 1.0},
            "there is no setting 'qqqqqq'; `servobench list KIND` (such as kams) or `servobench "
            "list SECTION` (such as camera) prints the settings",
        ),
        (
            {"angle_deg": 3.0},
            "angle_deg is the name of several settings, goal.angle_deg, start.angle_deg, "
            "region.angle_deg: give one of them with its table, as goal={'angle_deg': ...}",
        ),
        (
            {"gain": -1.0},
            "gain=-1.0: controller.gain = -1.0: input should be greater than or equal to 0.000001",
        ),
        (
            {"estimator": "jumb"},
            "estimator='jumb': estimator.kind: there is no kind 'jumb'; there is difference, "
            "error_kalman, imm, integral, jump, kalman_ca, kalman_cv, none, true",
        ),
    ],
)
def test_a_wrong_keyword_is_one_sentence(given, message):
    with pytest.raises(Mistake) as found:
        servo.load("still", **given)
    assert str(found.value) == message


def test_a_text_is_not_a_list_of_changes():
    with pytest.raises(Mistake, match=r"^'a=1': expected a list of changes, such as \['a=1'\]$"):
        servo.load("still", "a=1")
