"""Settings given from Python as keywords."""

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


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"gian": 1.0}, "there is no setting 'gian'; did you mean 'gain'?"),
        ({"qqqqqq": 1.0}, "there is no setting 'qqqqqq'"),
        (
            {"angle_deg": 3.0},
            "angle_deg: this is goal.angle_deg, start.angle_deg, region.angle_deg; say which, as in "
            "goal={'angle_deg': ...}",
        ),
        (
            {"gain": -1.0},
            "gain=-1.0: controller.gain = -1.0: input should be greater than or equal to 0.000001",
        ),
        (
            {"estimator": "jumb"},
            "estimator='jumb': estimator.kind: there is no kind 'jumb'; there is difference, "
            "error_kalman, imm, jump, kalman_ca, kalman_cv, none, true",
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
