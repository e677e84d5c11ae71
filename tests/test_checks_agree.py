"""The loop and `servo.testing` refuse the same parts, with the same sentence."""

import dataclasses
import sys
from decimal import Decimal
from types import SimpleNamespace

import numpy as np
import pytest
from made import Centre, Good, config_for, features

from servo import testing
from servo.loop.episode import Episode
from servo.mistake import Mistake
from servo.scenario.load import load
from servo.testing import BrokenContract
from servo.types import Command, Prediction
from sim.types import Effect, Pose
from tracking.types import State

SHORT = load("still", ["run.duration=0.2"])


def in_the_loop(place, config):
    """The sentence that the loop ends with; None if it does not."""
    part = (config(),) if place == "disturbances" else config()
    try:
        with Episode(dataclasses.replace(SHORT, **{place: part})) as episode:
            list(episode)
    except Mistake as error:
        return str(error)
    return None


def in_the_check(place, config):
    """The sentence that the check raises; None if it does not."""
    check = getattr(
        testing, "check_features" if place == "features" else f"check_{place.removesuffix('s')}"
    )
    try:
        check(config)
    except BrokenContract as error:
        return str(error)
    return None


def tracker(**changes):
    class Changed(Good):
        def update(self, frame, ego):
            return dataclasses.replace(super().update(frame), **changes)

    return config_for(Changed)


class Ends(Good):
    def update(self, frame, ego=None):
        sys.exit(3)


class Alone(Good):
    def update(self, frame):
        return super().update(frame)


def estimator(**changes):
    def make(rng):
        def predicted(k):
            return dataclasses.replace(Prediction.unmeasured(np.zeros(k), np.zeros(k)), **changes)

        return SimpleNamespace(
            start=lambda features: None,
            update=lambda error, own, dt: predicted(len(error)),
            skip=lambda own, dt: predicted(len(own.past)),
        )

    return config_for(make)


def controller(*twist, **more):
    return config_for(
        lambda rng: SimpleNamespace(
            start=lambda task: None, command=lambda *_: Command(*twist, **more)
        )
    )


def motion(rotation, translation):
    return config_for(lambda rng: SimpleNamespace(at=lambda time: Pose(rotation, translation)))


def disturbance(effect, **props):
    def at(time):
        return effect if time >= 0 else Effect()

    return config_for(lambda rng: SimpleNamespace(at=at, **props))


EYE = np.eye(3)
NONE = np.zeros(3)
UNFIT = [
    ("tracker", tracker(state=None), "Estimate.state is None; use tracking.types.State"),
    ("tracker", tracker(state=(1.0, 2.0, 0.0, 1.0)), "Estimate.state is (1.0, 2.0, 0.0, 1.0); use"),
    ("tracker", tracker(state=State("1", "2")), "its numbers must be finite"),
    ("tracker", tracker(state=State(Decimal(5), 1.0)), "its numbers must be finite"),
    ("tracker", tracker(state=State(1j, 1.0)), "its numbers must be finite"),
    ("tracker", tracker(state=State(np.array([5.0]), 1.0)), "its numbers must be finite"),
    ("tracker", tracker(state=State(10**400, 1.0)), "its numbers must be finite"),
    ("tracker", tracker(state=State(1.0, 1.0, 0.0, 1e200)), "none over 1e+09"),
    ("tracker", tracker(distance="0.1"), "Estimate.distance is '0.1'; it should be from 0 to 1"),
    ("tracker", tracker(follows=None), "it should be two flags: whether the tracker follows angle"),
    (
        "tracker",
        tracker(follows=(flag for flag in (True, True))),
        "it should be two flags: whether the tracker follows angle",
    ),
    (
        "tracker",
        tracker(follows=("yes", "no")),
        "it should be two flags: whether the tracker follows angle",
    ),
    ("tracker", tracker(covariance=[[0.0] * 4] * 4), "it should be an array (4, 4)"),
    ("tracker", tracker(covariance=np.full((4, 4), None)), "it should be an array (4, 4)"),
    ("tracker", tracker(covariance=np.eye(4) * 1j), "it should be an array (4, 4)"),
    ("tracker", tracker(corners=[[0.0, 0.0]] * 4), "it should be an array of four points"),
    ("tracker", tracker(corners=np.full((4, 2), None)), "it should be an array of four points"),
    ("tracker", tracker(particles="many"), "it should be an array (N, 5)"),
    ("tracker", tracker(particles=np.zeros(3)), "it should be an array (N, 5)"),
    ("tracker", tracker(particles=np.full((2, 5), np.nan)), "it should be an array (N, 5)"),
    ("tracker", config_for(Ends), "SystemExit: 3"),
    ("tracker", config_for(Alone), "TypeError: Alone.update() takes 2 positional arguments"),
    ("tracker", config_for(lambda rng: sys.exit(1)), "SystemExit: 1"),
    (
        "features",
        features(names=("x", "x")),
        "names are ('x', 'x'); they must be different texts, at least one",
    ),
    (
        "features",
        features(names=(1, 2)),
        "names are (1, 2); they must be different texts, at least one",
    ),
    ("features", features(units=("1",)), "there are 2 names and 1 units; give each feature a unit"),
    ("features", features(sole_dof={"x": "ux"}), "sole_dof has a key that is no feature"),
    ("features", features(noise=np.zeros(2)), "noise is not an array of 2 numbers above 0"),
    ("features", features(noise=[1e-3, 1e-3]), "noise is not an array of 2 numbers above 0"),
    (
        "features",
        features(values=lambda *_: [0.0, 0.0]),
        "values returned list; return a NumPy array (2,)",
    ),
    ("features", features(values=lambda *_: np.array(["a", "b"])), "all must be finite"),
    ("features", features(values=lambda *_: np.array([1j, 0])), "all must be finite"),
    (
        "features",
        features(matrix=lambda *_: None),
        "matrix returned NoneType; return a NumPy array (2, 6)",
    ),
    ("features", features(error=lambda *_: np.array([np.inf, 0.0])), "error returned [inf  0.]"),
    (
        "features",
        features(known=lambda *_: [True, True]),
        "known returned list; return a NumPy array (2,)",
    ),
    ("features", features(known=lambda *_: np.ones(2)), "it should be 2 flags"),
    ("features", features(scales=lambda *_: [1.0, 1.0]), "scales returned list"),
    ("features", features(scales=lambda *_: np.array([np.inf, 1.0])), "all must be finite"),
    ("estimator", estimator(error=np.zeros(3)), "error is [0. 0. 0.]; it should be 4 finite"),
    ("estimator", estimator(motion=[0.0] * 4), "motion is [0.0, 0.0, 0.0, 0.0]; it should be"),
    ("estimator", estimator(motion=np.full(4, np.nan)), "it should be 4 finite numbers"),
    ("estimator", estimator(innovation=None), "innovation is None; it should be 4 numbers, nan"),
    ("estimator", estimator(nis="none"), "nis is 'none'; it should be 4 numbers, nan for features"),
    (
        "controller",
        controller([0.0] * 6),
        "Command.twist is [0.0, 0.0, 0.0, 0.0, 0.0, 0.0]; it should be a NumPy array",
    ),
    ("controller", controller(np.zeros(6) * 1j), "Command.twist is [0.+0.j"),
    (
        "controller",
        controller(np.full(6, None)),
        "Command.twist is [None None None None None None]; it should be",
    ),
    (
        "controller",
        controller(np.zeros(6), trace="how"),
        "Command.trace is 'how'; use a servo.types.Trace, or None",
    ),
    ("motion", motion(EYE.tolist(), [0.0] * 3), "it should be finite numbers (3,)"),
    ("motion", motion(2 * EYE, NONE), "is no pose: its matrix (3, 3) is no rotation"),
    (
        "motion",
        motion(np.diag([1.0, 1.0, -1.0]), NONE),
        "is no pose: its matrix (3, 3) is no rotation",
    ),
    ("disturbances", disturbance(Effect()), "it has no tuple `props`"),
    ("disturbances", disturbance(Effect(), props=[]), "it has no tuple `props`"),
    (
        "disturbances",
        disturbance(Effect(gain="a"), props=()),
        "Effect.gain is 'a'; it should be a factor",
    ),
    (
        "disturbances",
        disturbance(Effect(gain=float("nan")), props=()),
        "Effect.gain is nan; it should be a",
    ),
    (
        "disturbances",
        disturbance(Effect(lamp=-1.0), props=()),
        "Effect.lamp is -1.0; it should be a factor",
    ),
]


@pytest.mark.parametrize(("place", "config", "sentence"), UNFIT)
def test_an_unfit_part_is_refused_by_both(place, config, sentence):
    for found in (in_the_loop(place, config), in_the_check(place, config)):
        assert sentence in (found or "")


class Single(Good):
    def update(self, frame, ego=None):
        found = super().update(frame)
        state = State(np.float32(found.state.x), np.float64(found.state.y), 0, True)
        return dataclasses.replace(found, state=state, distance=np.float32(found.distance))


FIT = [
    ("tracker", config_for(Single)),
    ("tracker", tracker(follows=[True, np.bool_(False)])),
    ("tracker", tracker(covariance=np.eye(4, dtype=np.float32))),
    ("tracker", tracker(corners=np.array([[40, 30], [70, 30], [70, 50], [40, 50]]))),
    ("features", features(names=["x", "y"], feed_forward=["x"])),
    (
        "features",
        features(matrix=lambda self, sight: Centre.matrix(self, sight).astype(np.float32)),
    ),
    ("estimator", estimator(motion=np.zeros(4, np.float32))),
    ("controller", controller(np.zeros(6, int))),
    ("motion", motion(np.eye(3, dtype=np.float32), np.zeros(3, int))),
    ("disturbances", disturbance(Effect(gain=np.float32(0.5)), props=())),
]


@pytest.mark.parametrize(("place", "config"), FIT)
def test_numbers_of_other_types_are_taken_by_both(place, config):
    assert (in_the_loop(place, config), in_the_check(place, config)) == (None, None)
