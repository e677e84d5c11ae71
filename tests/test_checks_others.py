"""The contract checks of feature sets, laws, estimators and what is in the world."""

import dataclasses
import itertools
from types import SimpleNamespace

import numpy as np
import pytest
from made import Centre, config_for, features

from servo.testing import BrokenContract, check_features, world_parts
from servo.testing.loop_parts import check_controller, check_estimator
from servo.testing.world_parts import check_disturbance, check_motion, check_robot, check_target
from servo.types import Command, Prediction
from sim.models.target import rectangle
from sim.robots import gantry
from sim.targets import car
from sim.types import Effect, Pose

NUMBERS = itertools.count()
FEATURES = {
    "names are ('x', 'x'); they must be different texts, at least one": {"names": ("x", "x")},
    "there are 2 names and 1 units; give each feature a unit": {"units": ("1",)},
    "feed_forward names features that the set does not have; take only those in names": {
        "feed_forward": ("z",)
    },
    "sole_dof has a key that is no feature, or a value that is not one of vx, vy": {
        "sole_dof": {"x": "ux"}
    },
    "noise is not an array of 2 numbers above 0": {"noise": np.zeros(2)},
    "values returned an array (3,); return a NumPy array (2,)": {
        "values": lambda self, sight: np.zeros(3)
    },
    "matrix returned an array (6, 2); return a NumPy array (2, 6)": {
        "matrix": lambda self, sight: np.zeros((6, 2))
    },
    "error(s, s) is [1. 1.]; return zeros for equal features": {
        "error": lambda self, s, g: np.ones(2)
    },
    "known returned bool; return a NumPy array (2,)": {"known": lambda self, sight: True},
    "scales returned [0. 0.]; all must be above 0": {"scales": lambda self, goal: np.zeros(2)},
    "the same view of the target gave other values the second time": {
        "values": lambda self, sight: np.full(2, float(next(NUMBERS)))
    },
    "but finite differences of the values give": {
        "matrix": lambda self, s: 1.01 * Centre.matrix(self, s)
    },
}


def test_features_of_a_user_pass():
    check_features(features())


@pytest.mark.parametrize("sentence", FEATURES)
def test_broken_features_get_their_sentence(sentence):
    with pytest.raises(BrokenContract) as broken:
        check_features(features(**FEATURES[sentence]))
    assert sentence in str(broken.value)


def estimator(update=None, skip=None):
    def make(rng):
        zero = Prediction.unmeasured(np.zeros(4), np.zeros(4))
        return SimpleNamespace(
            start=lambda features: None,
            rng=rng,
            update=lambda error, own, dt: (update or (lambda r: zero))(rng),
            skip=lambda own, dt: (skip or (lambda r: zero))(rng),
        )

    return config_for(make)


def predicted(error):
    return lambda rng: Prediction.unmeasured(error(rng), np.zeros(4))


OTHER_PARTS = {
    "skip returned NoneType; return a Prediction": (
        check_estimator, estimator(skip=lambda r: None)),
    "update: Prediction.error is [0. 0. 0.]; it should be 4 finite numbers": (
        check_estimator, estimator(update=lambda r: Prediction.unmeasured(*np.zeros((2, 3))))),
    "skip: Prediction.innovation has numbers, but nothing was measured": (
        check_estimator, estimator(skip=lambda r: Prediction(*np.zeros((4, 4))))),
    "the same errors gave other estimates the second time": (
        check_estimator, estimator(update=predicted(lambda r: np.random.default_rng().random(4)))),
    "it has a method aim, which is not called: command finds the goal in seen.goal": (
        check_controller, config_for(lambda rng: SimpleNamespace(
            start=print, aim=print, command=lambda *a: None))),
    "command returned NoneType; return a Command": (check_controller, config_for(
        lambda rng: SimpleNamespace(start=print, command=lambda *a: None))),
    "it should be a NumPy array of six finite numbers (vx, vy, vz, wx, wy, wz)": (check_controller, config_for(
        lambda rng: SimpleNamespace(
            start=lambda t: None, command=lambda *a: Command(np.zeros(5))))),
    "the same sights gave other twists the second time": (check_controller, config_for(
        lambda rng: SimpleNamespace(
            start=lambda t: None,
            command=lambda *a: Command(np.random.default_rng().random(6))))),
    "at returned NoneType; return a Pose": (
        check_motion, config_for(lambda rng: SimpleNamespace(at=lambda t: None))),
    "at(-0.1) is no pose": (check_motion, config_for(
        lambda rng: SimpleNamespace(at=lambda t: Pose(2 * np.eye(3), np.zeros(3))))),
    "jumps by 1 m within a millisecond": (check_motion, config_for(
        lambda rng: SimpleNamespace(at=lambda t: Pose(np.eye(3), np.array([t > 1, 0.0, 0.0]))))),
    "draw from build(rng) only": (check_motion, config_for(
        lambda rng: SimpleNamespace(
            at=lambda t: Pose(np.eye(3), 1e-3 * np.random.default_rng().random(3))))),
    "it has no tuple `props`": (
        check_disturbance, config_for(lambda rng: SimpleNamespace(at=lambda t: Effect()))),
    "its effect begins before time 0": (check_disturbance, config_for(
        lambda rng: SimpleNamespace(props=(), at=lambda t: Effect(gain=2.0)))),
    "build returned NoneType; return a Design": (check_robot, config_for(lambda rng: None)),
    "a home has 2 joints; the robot has 6": (check_robot, config_for(
        lambda rng: dataclasses.replace(gantry.Config().build(rng), homes=((0.0, 0.0),)))),
    "build returned NoneType; return a Target": (check_target, config_for(lambda rng: None)),
    "the outline: expected four corners of one height, got the heights [0.0, 0.0, 1.0, 0.0]": (check_target, config_for(
        lambda rng: dataclasses.replace(
            car.Config().build(rng), outline=rectangle(np.zeros(3), 0.2, 0.1) + np.eye(4, 3)))),
    "the outline: expected the four corners of a rectangle, clockwise as seen from above": (check_target, config_for(
        lambda rng: dataclasses.replace(
            car.Config().build(rng), outline=rectangle(np.zeros(3), 0.2, 0.1)[::-1]))),
    "the outline is 20 x 0.1 m; its sides have to be from 0.001 to 2": (check_target, config_for(
        lambda rng: dataclasses.replace(
            car.Config().build(rng), outline=rectangle(np.zeros(3), 20.0, 0.1)))),
    "the target's model has no geoms": (check_target, config_for(
        lambda rng: dataclasses.replace(car.Config().build(rng), spec=type(
            car.Config().build(rng).spec)()))),
}  # fmt: skip


@pytest.mark.parametrize("sentence", OTHER_PARTS)
def test_another_broken_part_gets_its_sentence(sentence):
    check, config = OTHER_PARTS[sentence]
    with pytest.raises(BrokenContract) as broken:
        check(config)
    assert sentence in str(broken.value)


def counting(call, answer):
    """A part whose answers grow from call to call, and which never begins anew."""

    def make(rng):
        numbers = itertools.count()
        part = SimpleNamespace(start=lambda task: None)
        part.skip = lambda own, dt: Prediction.unmeasured(np.zeros(4), np.zeros(4))
        setattr(part, call, lambda *given: answer(np.full(4, float(next(numbers)))))
        return part

    return config_for(make)


@pytest.mark.parametrize(
    ("check", "call", "answer"),
    [
        (check_estimator, "update", lambda n: Prediction.unmeasured(n, n)),
        (check_controller, "command", lambda n: Command(np.resize(n, 6))),
    ],
)
def test_a_second_start_has_to_forget_the_first(check, call, answer):
    with pytest.raises(BrokenContract, match=r"^a second start did not forget the first; reset"):
        check(counting(call, answer))


def moving(jump):
    """A motion that is elsewhere by a jump [m] a millisecond after each time of the check."""
    return config_for(
        lambda rng: SimpleNamespace(
            at=lambda t: Pose(
                np.eye(3), np.array([0.0 if t in world_parts.TIMES else jump, 0.0, 0.0])
            )
        )
    )


def test_a_motion_may_move_by_less_than_a_centimetre_a_millisecond():
    check_motion(moving(0.00999))
    with pytest.raises(BrokenContract, match=r"at\(-0\.1\) jumps by 0\.01 m within a millisecond"):
        check_motion(moving(0.01))


@pytest.mark.parametrize(("length", "width"), [(2.0, 0.1), (0.1, 1e-3)])
def test_an_outline_may_be_from_a_millimetre_to_two_metres(length, width):
    def sized(a, b):
        outline = rectangle(np.zeros(3), a, b)
        return config_for(lambda rng: dataclasses.replace(car.Config().build(rng), outline=outline))

    check_target(sized(length, width))
    factor = 1.01 if length == 2.0 else 0.99
    with pytest.raises(BrokenContract, match=r"its sides have to be from 0\.001 to 2"):
        check_target(sized(length * factor, width * factor))


def test_an_estimator_is_checked_with_gaps_and_with_errors_that_are_not_measured():
    """Its last feature is unknown in the pictures 0, 1 and 8, and nothing is in 12 to 14."""
    calls = []

    def told(what):
        def called(rng):
            calls.append(what)
            return Prediction.unmeasured(np.zeros(4), np.zeros(4))

        return called

    def make(rng):
        def update(error, own, dt):
            return told((np.isfinite(error).tolist(), error[0]))(rng)

        def skip(own, dt):
            return told(None)(rng)

        return SimpleNamespace(start=lambda features: None, update=update, skip=skip)

    check_estimator(config_for(make))
    assert calls[0] is None
    known = [call and call[0] for call in calls[1:21]]
    some = [True, True, True, False]
    assert known == [
        *[some] * 2, *[[True] * 4] * 6, some, *[[True] * 4] * 3, *[None] * 3, *[[True] * 4] * 5
    ]  # fmt: skip
    errors = [call[1] for call in calls[1:21] if call]
    expected = 0.01 * np.delete(np.arange(20), [12, 13, 14])
    np.testing.assert_allclose(errors, expected, atol=5e-4)
