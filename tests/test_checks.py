"""The contract checks of servo.testing: our parts pass, and each broken one gets its sentence."""

import dataclasses
import math
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

from servo import testing
from servo.scenario.catalogue import LISTS, PLUGINS
from servo.testing import BrokenContract, check_features, check_tracker
from servo.testing.loop_parts import check_controller, check_estimator
from servo.testing.world_parts import check_disturbance, check_motion, check_robot, check_target
from servo.types import Command, Prediction
from sim import kinds
from sim.robots import gantry
from sim.target import rectangle
from sim.targets import car
from sim.types import Effect, Pose
from tracking.types import Estimate, State, Status, check_region, unknown_covariance

FOLDERS = {part: folder for part, (folder, _) in PLUGINS.items()} | LISTS
CHECKS = {part: getattr(testing, f"check_{part.removesuffix('s')}", None) for part in FOLDERS}
CHECKS["features"] = check_features
EVERY = [(part, kind) for part, folder in FOLDERS.items() for kind in kinds.names(folder)]


@pytest.mark.parametrize(("part", "kind"), [e for e in EVERY if e[1] not in ("opencv", "trax")])
def test_every_shipped_kind_keeps_its_contract(part, kind):
    CHECKS[part](kind)


def config_for(make):
    """A `Config` class whose build gives what a function makes of it."""

    @dataclass(frozen=True)
    class Config:
        def build(self, rng):
            return make(rng)

    return Config


class Good:
    """A tracker that sees a blue target, and changes nothing."""

    def __init__(self, rng):
        self.rng = rng

    def start(self, frame, region, state):
        check_region(frame, region, state)
        self.state = state

    def update(self, frame, ego=None):
        red, _, blue = np.moveaxis(frame.image.astype(int), -1, 0)
        rows, columns = np.nonzero(blue > red + 100)
        seen = len(rows) > 0
        if seen:
            self.state = State(columns.mean() + 0.5, rows.mean() + 0.5)
        status = Status.LOCKED if seen else Status.LOST
        return Estimate(self.state, unknown_covariance(), float(not seen), status)


def changed(**changes):
    """A tracker whose estimates are changed."""

    class Changed(Good):
        def update(self, frame, ego=None):
            return dataclasses.replace(super().update(frame), **changes)

    return Changed


class Writes(Good):
    def update(self, frame, ego=None):
        frame.image[0, 0] = 0
        return super().update(frame)


class Dice(Good):
    def update(self, frame, ego=None):
        return dataclasses.replace(
            super().update(frame), state=State(np.random.default_rng().random(), 1.0)
        )


class Identity(Good):
    def update(self, frame, ego=None):
        self.before = getattr(self, "before", frame.image)
        state = State(float(self.before is frame.image), float(self.before.sum()))
        return dataclasses.replace(super().update(frame), state=state)


class Fragile(Good):
    def update(self, frame, ego=None):
        return dataclasses.replace(super().update(frame), distance=1 / int(frame.image.any()))


class AnyRegion(Good):
    def start(self, frame, region, state):
        self.state = state


class Nothing(Good):
    def update(self, frame, ego=None):
        return None


TRACKERS = {
    "update returned NoneType; return an Estimate": Nothing,
    "its numbers must be finite, scale above 0": changed(state=State(math.nan, 1.0)),
    "; its numbers must be finite": changed(state=State(1.0, 1.0, 0.0, 0.0)),
    "the distance is 1.5; it goes from 0 to 1": changed(distance=1.5),
    "the status is 'LOCKED'; use tracking.types.Status": changed(status="LOCKED"),
    "the covariance is not (4, 4); a tracker without one": changed(covariance=np.zeros(4)),
    "none can be negative": changed(covariance=-np.eye(4)),
    "the corners are not four points (4, 2)": changed(corners=np.zeros((4, 3))),
    "it writes into frame.image; work on a copy": Writes,
    "the same pictures gave other states the second time": Dice,
    "the states differ where the caller uses one buffer for all pictures": Identity,
    "a black picture of 160 x 120 px made update raise ZeroDivisionError: ": Fragile,
    "the status is LOCKED two seconds after the target has gone": changed(status=Status.LOCKED),
    "start took a region of 0 x 20 px; raise a ValueError": AnyRegion,
    "build(rng) gave Namespace, which has no method start": lambda rng: Namespace(),
}


class Namespace:
    pass


def test_a_tracker_of_a_user_passes():
    check_tracker(config_for(Good))
    check_tracker(config_for(Good)())


@pytest.mark.parametrize("sentence", TRACKERS)
def test_a_broken_tracker_gets_its_sentence(sentence):
    with pytest.raises(BrokenContract) as broken:
        check_tracker(config_for(TRACKERS[sentence]))
    assert sentence in str(broken.value)


@pytest.mark.parametrize(("part", "sentence"), [
    ("nothing", "there is no kind 'nothing'; there is annealed"),
    ("no.such:Name", "'no.such:Name' cannot be imported: No module named 'no'"),
    (3, "'3' is no Config: that is a dataclass with a method build(rng)"),
])  # fmt: skip
def test_what_is_no_part_is_a_sentence(part, sentence):
    with pytest.raises(BrokenContract) as broken:
        check_tracker(part)
    assert str(broken.value).startswith(sentence)


class Centre:
    """The centroid as features, right by the textbook for a target parallel to the image."""

    names, units, noise = ("x", "y"), ("1", "1"), np.full(2, 1e-3)
    feed_forward, sole_dof = ("x",), {}

    def values(self, sight):
        return np.array([sight.moments.xg, sight.moments.yg])

    def matrix(self, sight):
        from servo.features._interaction import interaction

        m = sight.moments  # xn = an xg with an = K / sqrt(a): differentiate the quotient
        L, an = interaction(m, sight.plane, 1.0), 1 / math.sqrt(m.area)
        return np.array([(L[0] - m.xg * L[2]) / an, (L[1] - m.yg * L[2]) / an])

    def error(self, values, goal):
        return values - goal

    def known(self, sight):
        return np.array([True, True])

    def scales(self, goal):
        return np.ones(2)


def features(**changes):
    @dataclass(frozen=True)
    class Config:
        def build(self, outline):
            return type("Changed", (Centre,), changes)()

    return Config


FEATURES = {
    "names are ('x', 'x'); all must differ": {"names": ("x", "x")},
    "there are 2 names and 1 units": {"units": ("1",)},
    "feed_forward names features that are none": {"feed_forward": ("z",)},
    "sole_dof maps names of features to some of vx, vy": {"sole_dof": {"x": "ux"}},
    "noise is not 2 numbers above 0": {"noise": np.zeros(2)},
    "values are (3,); they should be (2,)": {"values": lambda self, sight: np.zeros(3)},
    "the matrix is (6, 2), not (2, 6)": {"matrix": lambda self, sight: np.zeros((6, 2))},
    "error(s, s) is [1. 1.]; it should be zero": {"error": lambda self, s, g: np.ones(2)},
    "known is not 2 flags": {"known": lambda self, sight: True},
    "scales are not 2 numbers above 0": {"scales": lambda self, goal: np.zeros(2)},
    "its values change by": {"matrix": lambda self, s: 1.01 * Centre.matrix(self, s)},
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
            start=lambda features: None, rng=rng,
            update=lambda error, own, dt: (update or (lambda r: zero))(rng),
            skip=lambda own, dt: (skip or (lambda r: zero))(rng),
        )  # fmt: skip

    return config_for(make)


def predicted(error):
    return lambda rng: Prediction.unmeasured(error(rng), np.zeros(4))


OTHER_PARTS = {
    "skip before any update returned NoneType, not a Prediction": (
        check_estimator, estimator(skip=lambda r: None)),
    "update: error is [0. 0. 0.]; it should be 4 finite numbers": (
        check_estimator, estimator(update=predicted(lambda r: np.zeros(3)))),
    "nothing was measured, so the innovation is nan": (
        check_estimator, estimator(skip=lambda r: Prediction(*np.zeros((4, 4))))),
    "the same errors gave other estimates the second time": (
        check_estimator, estimator(update=predicted(lambda r: np.random.default_rng().random(4)))),
    "command returned NoneType; return a Command": (check_controller, config_for(
        lambda rng: SimpleNamespace(start=print, aim=print, command=lambda *a: None))),
    "it should be six finite numbers (vx, vy, vz, wx, wy, wz)": (check_controller, config_for(
        lambda rng: SimpleNamespace(
            start=lambda t: None, aim=lambda g: None, command=lambda *a: Command(np.zeros(5))))),
    "the same sights gave other twists the second time": (check_controller, config_for(
        lambda rng: SimpleNamespace(
            start=lambda t: None, aim=lambda g: None,
            command=lambda *a: Command(np.random.default_rng().random(6))))),
    "at(-0.1) returned NoneType, not a Pose": (
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
    "it does something before time 0": (check_disturbance, config_for(
        lambda rng: SimpleNamespace(props=(), at=lambda t: Effect(gain=2.0)))),
    "build(rng) gave NoneType; return a Design": (check_robot, config_for(lambda rng: None)),
    "a home has 2 joints; the robot has 6": (check_robot, config_for(
        lambda rng: dataclasses.replace(gantry.Config().build(rng), homes=((0.0, 0.0),)))),
    "build(rng) gave NoneType; return a Target": (check_target, config_for(lambda rng: None)),
    "the outline is not level": (check_target, config_for(
        lambda rng: dataclasses.replace(
            car.Config().build(rng), outline=rectangle(np.zeros(3), 0.2, 0.1) + np.eye(4, 3)))),
    "the outline's corners are in another order": (check_target, config_for(
        lambda rng: dataclasses.replace(
            car.Config().build(rng), outline=rectangle(np.zeros(3), 0.2, 0.1)[::-1]))),
    "the outline is 20 x 0.1 m; its sides go from 0.001 to 2": (check_target, config_for(
        lambda rng: dataclasses.replace(
            car.Config().build(rng), outline=rectangle(np.zeros(3), 20.0, 0.1)))),
    "its model has no geoms": (check_target, config_for(
        lambda rng: dataclasses.replace(car.Config().build(rng), spec=type(
            car.Config().build(rng).spec)()))),
}  # fmt: skip


@pytest.mark.parametrize("sentence", OTHER_PARTS)
def test_another_broken_part_gets_its_sentence(sentence):
    check, config = OTHER_PARTS[sentence]
    with pytest.raises(BrokenContract) as broken:
        check(config)
    assert sentence in str(broken.value)
