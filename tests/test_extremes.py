"""A short run ends normally with each setting at its smallest and at its largest value."""

import dataclasses
import functools
from itertools import starmap

import numpy as np
import pytest
from every_setting import KINDS, settings_of
from hypothesis import given, settings
from hypothesis import strategies as st

from servo.loop.episode import Episode
from servo.loop.measure import COUNTED
from servo.loop.run_measures import summarise
from servo.mistake import Mistake
from servo.scenario import load as s
from servo.scenario import toml
from servo.scenario.catalogue import LISTS, PLUGINS
from servo.scenario.toml import put
from sim.ranges import LONGEST

SHORT = """
camera = { width = 96, height = 72, exposure = 0.5 }
run.duration = 0.26
goal = { depth_to = 1.2, change_start = 0.05, change_duration = 0.1 }
start = { x = 5.0, y = -4.0, angle_deg = 5.0 }
motion.kind = "line"
motion.x = 0.0
disturbances = [{ kind = "brightness", factor = 0.0, start = 0.13, ramp = 0.001 }]
"""
"""Eight frames; from the fifth on the picture is black: the controller coasts, holds, searches."""
BLURRED = ("camera", "world", "motion")
"""Places of settings that act on the blur of a picture, which is the mean of several."""
EVERYTHING = {
    "gain_far": 1.0,
    "smooth_start": 1.0,
    "secondary": ["level", "avoid_limits", "centre"],
    "dof": ["vx", "vy", "vz", "wx", "wy", "wz"],
    "coast": 0.04,
    "search_after": 0.04,
}
"""Settings of the controller with which all others matter."""
FOLLOWS = ("camera", "robot", "target", "leader", "motion", "tracker", "features")
"""What of the scenario `hand_follow` makes the settings of a leader matter."""
EARLY = {"start": 0.05, "duration": 0.1}
"""Settings of a disturbance with which it acts within a short run."""
REFUSED = (
    "the robot cannot bring the camera",
    "the robot cannot bring the target",
    "most of it must be inside the image",
    "both sides must be at least 4 px",
    "no component of the twist move",
    "this tracker reports a rectangle, which does not show a tilt",
    "did not answer within 0.1 s",
    "the additional modules has no tracker",
    "has no model file",
    "has no score",
    "the command of the TraX server is empty",
    "the command of the program is empty",
    "OpenCV's MIL reports no confidence",
    "cannot be started",
    "is more than 85 deg from the optical axis",
    "is far outside of a picture",
    "fy needs fx",
    "coefficients, not 0",
    "coefficients need a distortion",
    "there is no body or site 'xn'",
    "there is no camera 'xn'",
    "give either camera",
    "cannot read this robot model",
    "home has 1 joint positions",
    "home has 6 joint positions",
    "has 2 values; it should",
    "cannot read this calibration",
    "no file of this name is shipped",
    "this colour is not known",
    "nothing is left of a picture",
    "pose sets the whole start pose",
    "the target would be below the table",
    "no AprilTag 36h11",
    "only ratios count",
    "do not fit into a frame",
    "so the goal must not move",
    "and file go together",
    "pose and held need mounted",
    "the robot holds the target",
    "in the first picture",
    "is the target's own tag",
    "would be behind the camera",
    "need depth = true",
    "needs a depth picture",
    "needs a table [recording]",
    "the first should be smaller",
)
"""What a scenario within all limits may be refused for."""


def base(place, kind):
    """A short scenario with a kind in its place, in which its settings matter."""
    table = toml.decode(SHORT, "short")
    if place == "leader":
        follows = s.load("hand_follow").table
        table = {"run": table["run"]} | {name: follows[name] for name in FOLLOWS}
    if place not in BLURRED:
        table["camera"] = table["camera"] | {"exposure": 0.0}
    if place in LISTS:
        names = {f.name for f in dataclasses.fields(LISTS[place].config_of(kind))}
        table[place] = [{"kind": kind} | {k: v for k, v in EARLY.items() if k in names}]
    elif place in PLUGINS:
        table[place] = {"kind": kind} | (EVERYTHING if kind in ("ibvs", "qp") else {})
    return table


OF_FILES = ("onnx", "program")
"""Controllers that need a file: test_onnx_policy, test_policy_program."""


def cases():
    """Every setting of every kind at each end; what several kinds inherit, in the first of them.

    An end that is the default is the same run for all settings of a kind: it is the first one's.
    """
    seen, usual = set(), set()
    for place, kind, config in KINDS:
        if kind in OF_FILES:
            continue
        at = f"{place}.0" if place in LISTS else place
        for owner, name, values in settings_of(config):
            if (owner, name) in seen:
                continue
            seen.add((owner, name))
            for value in values:
                if not too_long(kind, name, value):
                    if is_usual(place, kind, config, name, value):
                        if (place, kind) in usual:
                            continue
                        usual.add((place, kind))
                    label = f"{kind or place}-{name}={value}"
                    yield pytest.param(place, kind, {f"{at}.{name}": value}, id=label)


def is_usual(place, kind, config, name, value):
    """Whether a short scenario with a kind has this value of a setting already."""
    there = base(place, kind).get(place, {})
    if name.partition(".")[0] in (there[0] if isinstance(there, list) else there):
        return False
    default = functools.reduce(getattr, name.split("."), config())
    default = getattr(default, "value", default)
    default = list(default) if isinstance(default, tuple) else default
    return type(default) is type(value) and default == value


def too_long(kind, name, value):
    """Whether this takes seconds; the particles of one kind stand for those of all."""
    return (
        (name == "duration" and value == LONGEST and kind is None)
        or (name == "particles" and value > 1 and kind != "condensation")
        or (name == "density" and value > 100)
    )


def run_short(place, kind, changes):
    """Run a short scenario with changes; whatever it says is a number."""
    table, refused = base(place, kind), ""
    for key, value in changes.items():
        put(table, key, value, "short")
    try:
        scenario = s.parse(table, "short", "short")
        with Episode(scenario) as episode:
            steps = [step.light() for step in episode]
            assert not episode.world.data.warning.number.any()  # MuJoCo's own, of nan and the like
    except Mistake as mistake:
        steps, refused = [], str(mistake)
    if refused:
        assert any(reason in refused for reason in REFUSED), refused
        return
    for step in steps:
        predicted, state = step.prediction, dataclasses.astuple(step.estimate.state)
        numbers = (step.error, predicted.error, predicted.motion) if step.command.trace else ()
        for values in (
            step.command.twist,
            *numbers,
            step.bodies,
            step.joints,
            step.rates,
            step.twist_measured,
            state,
            step.estimate.distance,
        ):
            assert np.isfinite(values).all()
        pixels = step.goal_sight.picture is not None
        assert np.isfinite(step.target_motion_true).all() != pixels
    report = summarise(steps, scenario.measure, 1 / scenario.camera.rate)
    unknown = ("settle_s", *(COUNTED if scenario.measure.after > steps[-1].frame.time else ()))
    assert all(np.isfinite(value) for name, value in report.measures.items() if name not in unknown)


@pytest.mark.parametrize(("place", "kind", "changes"), [*cases()])
def test_a_short_run_ends_normally_at_the_limits_of_every_setting(place, kind, changes):
    run_short(place, kind, changes)


LONG = (
    "particles",
    "density",
    "layers",
    "climb",
    "steps",
    "duration",
    "width",
    "height",
    "physics_rate",
    "rate",
)
"""Settings at whose ends a run takes long."""


def drawn_settings(config):
    """The settings of a kind that have ends or choices, and do not make a run long."""
    return [
        (name, values) for _, name, values in settings_of(config) if values and name not in LONG
    ]


def anything(config, at):
    """Any few settings of a kind, each at one of its ends or choices."""
    every = [(f"{at}.{name}", values) for name, values in drawn_settings(config)]
    few = st.lists(st.sampled_from(every), max_size=6, unique_by=lambda one: one[0])
    return few.flatmap(
        lambda chosen: st.fixed_dictionaries(
            dict(starmap(lambda key, values: (key, st.sampled_from(values)), chosen))
        )
    )


PLACES = ("controller", "estimator", "motion", "robot", "goal", "tracker")
LOOP = [k for k in KINDS if k[0] in PLACES and k[1] not in OF_FILES and drawn_settings(k[2])]


@pytest.mark.wide
@settings(max_examples=30)
@given(st.sampled_from(LOOP).flatmap(lambda k: st.tuples(st.just(k), anything(k[2], k[0]))))
def test_a_short_run_ends_normally_at_several_limits_at_once(drawn):
    (place, kind, _), changes = drawn
    run_short(place, kind, changes)
