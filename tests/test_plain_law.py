"""A control law that is a plain class, an object or a function."""

import numpy as np
import pytest

import servo
from servo import Mistake
from servo.parts import Prediction
from servo.testing import check_controller
from tracking.types import Estimate, Status

SHORT = ["run.duration=0.3", "start.x=20"]
LEVEL = [0, 1, 2, 5]


def proportional(seen, task, *, gain=1.5, names=None, kept=[]):  # noqa: B006
    features = task.features
    error = features.error(features.values(seen), features.values(task.goal))
    twist = np.zeros(6)
    twist[LEVEL] = -gain * np.linalg.pinv(features.matrix(seen)[:, LEVEL]) @ error
    return twist


class Plain:
    """The same as a class."""

    def __init__(self, gain=1.0, kind="mine"):
        self.gain = gain

    def start(self, task):
        self.task = task

    def command(self, seen, posture, dt):
        asked = np.zeros(6) if seen is None else proportional(seen, self.task, gain=self.gain)
        return servo.Command(asked)


def test_a_function_and_a_class_are_the_same_law():
    each = [
        [step.command.twist for step in servo.run(servo.load("still", SHORT, **given))]
        for given in (
            {"controller": proportional, "gain": 2},
            {"controller": Plain, "gain": 2.0},
            {"controller": Plain(2)},
        )
    ]
    assert np.abs(each[0]).max() > 0.05
    assert np.array_equal(each[0], each[1])
    assert np.array_equal(each[0], each[2])


def test_arguments_with_a_default_are_the_settings():
    scenario = servo.load("still", controller=proportional, gain=2)
    assert scenario.settings()["controller"] == {
        "kind": f"{__name__}:proportional",
        "gain": 2,
        "names": None,
    }
    with pytest.raises(Mistake, match=r"^gain='x': controller.gain = 'x': input should be a valid"):
        servo.load("still", controller=proportional, gain="x")
    assert list(servo.load("still", controller=Plain).settings()["controller"]) == ["kind", "gain"]


def test_a_function_is_given_the_goal_of_now_and_stands_still_without_a_target():
    goals = []

    def law(seen, task):
        goals.append(task.features.values(task.goal)[2])
        return servo.Command(np.full(6, 1e-3))

    moving = ["goal.depth_to=0.8", "goal.change_start=0", "goal.change_duration=1"]
    hidden = "disturbances=[{ kind = 'dropped_frames', share = 0.5 }]"
    found = list(
        servo.run(servo.load("still", [*SHORT, *moving, hidden, "run.duration=1"], controller=law))
    )
    assert len(set(goals)) == len(goals) < len(found)
    still = [not step.command.twist.any() for step in found]
    assert still.count(True) == len(found) - len(goals)


def test_plain_laws_are_checked_as_others():
    check_controller(proportional)
    check_controller(Plain)


@pytest.mark.parametrize(
    ("law", "sentence"),
    [
        (
            lambda seen, task: np.zeros(3),
            "Command.twist is [0. 0. 0.]; it should be a NumPy array of six finite numb",
        ),
        (lambda seen, task: np.full(6, 1j), "Command.twist is ["),
        (
            lambda seen, task: None,
            "Command.twist is nan; it should be a NumPy array of six finite numbers",
        ),
        (type("Bare", (), {"command": print}), "build returned Bare, which has no method start"),
        (lambda: 3, "TypeError: "),
        (3, "controller: '3' is no Config: "),
        (np.zeros, "controller: 'zeros' is no Config: "),
    ],
)
def test_what_is_no_law_is_one_sentence(law, sentence):
    with pytest.raises(Mistake) as found:
        servo.simulate("still", ["run.duration=0.1"], controller=law)
    assert sentence in str(found.value)
    assert "\n" not in str(found.value)


class Still:
    """A tracker of a class alone; it reports the first state, and draws from the run's numbers."""

    def __init__(self, quality=0.5, rng=None):
        self.quality = quality
        self.drawn = rng.random()

    def start(self, frame, region, state):
        self.state = state

    def update(self, frame, ego=None):
        return Estimate(self.state, np.eye(4), self.quality, Status.LOCKED)


class Nothing:
    """An estimator that knows of no motion."""

    def start(self, features):
        self.nothing = np.zeros((4, len(features.names)))

    def update(self, error, own, dt):
        return Prediction(np.nan_to_num(error), *self.nothing[1:])

    def skip(self, own, dt):
        return Prediction(*self.nothing)


def test_a_plain_class_is_a_tracker_or_an_estimator():
    scenario = servo.load("still", SHORT, tracker=Still, estimator=Nothing)
    assert scenario.settings()["tracker"] == {"kind": f"{__name__}:Still", "quality": 0.5}
    first, again = (scenario.tracker.build(np.random.default_rng(s)).drawn for s in (3, 3))
    assert first == again == np.random.default_rng(3).random()
    by_name = servo.load("still", [*SHORT, f"tracker.kind={__name__}:Still", "tracker.quality=1"])
    assert [type(s.tracker.build(np.random.default_rng(0))) for s in (scenario, by_name)] == [
        Still,
        Still,
    ]
    assert by_name.tracker.quality == 1
    assert len(list(servo.run(scenario))) == 9


def test_the_errors_of_a_law_that_returns_only_a_twist_are_recorded():
    scenario = servo.load("still", SHORT, controller=proportional)
    steps = list(servo.run(scenario))
    shipped = list(servo.run(servo.load("still", [*SHORT, "controller.gain=1.5"])))
    first, same = steps[0], shipped[0]
    np.testing.assert_allclose(first.features, same.features)
    np.testing.assert_allclose(first.error, same.error)
    np.testing.assert_array_equal(first.prediction.error, first.error)
    assert np.isnan(first.prediction.motion).all()
    lost = servo.load("still", [*SHORT, "camera.noise=0"], controller=proportional, tracker=Lost)
    assert list(servo.run(lost))[-1].command.trace is None


class Lost:
    """A tracker that does not see its target."""

    def start(self, frame, region, state):
        self.state = state

    def update(self, frame, ego):
        return Estimate(self.state, np.full((4, 4), np.nan), 1.0, Status.LOST)
