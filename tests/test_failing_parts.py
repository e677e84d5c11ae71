"""A part that raises, or gives what has no meaning, is named in one sentence."""

import dataclasses
from dataclasses import dataclass
from types import SimpleNamespace
from typing import ClassVar

import numpy as np
import pytest

from servo.estimators.none import Nothing
from servo.features.moments import MomentFeatures, Scaling
from servo.loop.episode import run
from servo.loop.part_failures import PartFailed
from servo.mistake import Mistake
from servo.scenario.load import load
from servo.testing import check_tracker
from servo.types import Command, Prediction, Trace
from sim.channels import Channel
from sim.types import Pose
from tracking.types import Estimate, State, Status, check_region, unknown_covariance

SHORT = ["run.duration=0.2", "estimator.kind=none", "expect={}"]


@dataclass(frozen=True)
class Given:
    """A `Config` that builds what it was given."""

    make: object
    kind: ClassVar[str] = "odd"

    def build(self, rng):
        return self.make(rng)


class Still:
    """A tracker that sees the target where it was first."""

    def start(self, frame, region, state):
        self.state = state

    def update(self, frame, ego=None):
        return self.changed(Estimate(self.state, unknown_covariance(), 0.0, Status.LOCKED))

    def changed(self, estimate):
        return estimate


def tracker(changed=None, **methods):
    changes = {"changed": lambda self, e: changed(e)} if changed else {}
    return {"tracker": Given(lambda rng: type("Odd", (Still,), changes | methods)())}


def raises(error):
    def method(self, *args, **kwargs):
        raise error

    return method


def controller(command):
    law = SimpleNamespace(start=lambda task: None, command=lambda *a: command)
    return {"controller": Given(lambda rng: law)}


def at(pose):
    return {"motion": Given(lambda rng: SimpleNamespace(at=lambda t: pose(t)))}


ORIGIN = np.array([0.0, 0.0, 0.0])
FAILURES = {
    "tracker 'odd': RuntimeError: no weights": tracker(start=raises(RuntimeError("no weights"))),
    "tracker 'odd': KeyError: 'x'": tracker(update=raises(KeyError("x"))),
    "tracker 'odd': the network gave nothing": tracker(
        update=raises(ValueError("the network gave nothing"))),
    "tracker 'odd': update returned NoneType; return an Estimate": tracker(lambda e: None),
    "tracker 'odd': Estimate.state is State(x=nan, y=1.0, theta=0.0, scale=1.0); its numbers must be "
    "finite, scale above 0": tracker(
        lambda e: dataclasses.replace(e, state=State(float("nan"), 1.0))),
    "tracker 'odd': Estimate.state is State(x=1.0, y=1.0, theta=0.0, scale=-1.0); its numbers must be "
    "finite, scale above 0": tracker(
        lambda e: dataclasses.replace(e, state=State(1.0, 1.0, 0.0, -1.0))),
    "tracker 'odd': Estimate.distance is 1.5; it should be from 0 to 1": tracker(
        lambda e: dataclasses.replace(e, distance=1.5)),
    "tracker 'odd': build returned SimpleNamespace, which has no method start": {
        "tracker": Given(lambda rng: SimpleNamespace())},
    "tracker 'odd': Estimate.status is 'LOST'; use tracking.types.Status": tracker(
        lambda e: dataclasses.replace(e, status="LOST")),
    "tracker 'odd': Estimate.corners is [[nan nan]":
        tracker(lambda e: dataclasses.replace(e, corners=np.full((4, 2), np.nan))),
    "tracker 'odd': Estimate.evaluations is 'x'; it should be a whole number of at least 0": tracker(
        lambda e: dataclasses.replace(e, evaluations="x")),
    "tracker 'odd': Estimate.evaluations is -5; it should be a whole number of at least 0": tracker(
        lambda e: dataclasses.replace(e, evaluations=-5)),
    "tracker 'odd': Estimate.evaluations is 2.5; it should be a whole number of at least 0": tracker(
        lambda e: dataclasses.replace(e, evaluations=2.5)),
    f"tracker 'odd': Estimate.evaluations is {2**63}; it should be a whole number of at least 0": tracker(
        lambda e: dataclasses.replace(e, evaluations=2**63)),
    "tracker 'odd': Estimate.evaluations is nan; it should be a whole number of at least 0": tracker(
        lambda e: dataclasses.replace(e, evaluations=np.nan)),
    "tracker 'odd': Estimate.ess is 'a'; it should be a number of at least 0, or nan": tracker(
        lambda e: dataclasses.replace(e, ess="a")),
    "tracker 'odd': Estimate.ess is -1.0; it should be a number of at least 0, or nan": tracker(
        lambda e: dataclasses.replace(e, ess=-1.0)),
    "controller 'odd': Command.saturated is 'no'; it should be True or False": controller(
        Command(np.zeros(6), saturated="no")),
    "controller 'odd': Command.mode is 'SERVOING'; use servo.types.Mode": controller(
        Command(np.zeros(6), mode="SERVOING")),
    "controller 'odd': Command.limits is 'speed'; it should be a tuple of names": controller(
        Command(np.zeros(6), limits="speed")),
    "controller 'odd': Command.violated is (3,); it should be a tuple of names": controller(
        Command(np.zeros(6), violated=(3,))),
    "controller 'odd': Command.trace is 'how'; use a servo.types.Trace, or None": controller(
        Command(np.zeros(6), trace="how")),
    "controller 'odd': Trace.error is 'x'; it should be 4 numbers, nan for unknown ones": controller(
        Command(np.zeros(6), trace=Trace(np.zeros(4), "x", None, np.ones(4), np.zeros(4)))),
    "controller 'odd': command returned list; return a Command": controller([0.0] * 6),
    "controller 'odd': Command.twist is [nan  0.  0.  0.  0.  0.]; it should be a NumPy array of six finite numbers":
        controller(Command(np.array([np.nan, 0, 0, 0, 0, 0]))),
    "controller 'odd': Command.twist is [0.0, 0.0, 0.0, 0.0, 0.0, 0.0]; it should be a NumPy array of six":
        controller(Command([0.0] * 6)),
    "controller 'odd': Command.twist is [0 0 0 0 0 0]; it should be a NumPy array of six ":
        controller(Command(np.zeros(6, object))),
    "controller 'odd': Command.twist is [0. 0. 0.]; it should be a NumPy array of six finite numbers":
        controller(Command(np.zeros(3))),
    "motion 'odd': Pose.translation is [ 0. nan  0.]; it should be finite numbers (3,)": at(
        lambda t: Pose(np.eye(3), ORIGIN if t < 0.05 else np.array([0.0, np.nan, 0.0]))),
    "motion 'odd': at returned NoneType; return a Pose": at(lambda t: None),
    "still: robot: wrong base": {"robot": Given(raises(ValueError("wrong base")).__get__(0))},
    "target 'odd': TypeError: no mesh": {"target": Given(raises(TypeError("no mesh")).__get__(0))},
}  # fmt: skip


@pytest.mark.parametrize("sentence", FAILURES)
def test_a_part_that_fails_is_named(sentence):
    scenario = dataclasses.replace(load("still", SHORT), **FAILURES[sentence])
    with pytest.raises(Mistake) as failed:
        list(run(scenario))
    assert str(failed.value).startswith(sentence)


class Sees:
    """A law in the module of the tracker above."""

    def start(self, task):
        self.broken = False

    def command(self, seen, posture, dt):
        return 1 // 0


def test_parts_that_share_a_module_are_told_apart():
    parts = {"tracker": Given(lambda rng: Still()), "controller": Given(lambda rng: Sees())}
    scenario = dataclasses.replace(load("still", SHORT), **parts)
    with pytest.raises(PartFailed, match=r"^controller 'odd': ZeroDivisionError") as failed:
        list(run(scenario))
    assert isinstance(failed.value.__cause__, ZeroDivisionError)


def test_an_exception_that_ends_generators_is_named_too():
    class Closes(Sees):
        def command(self, seen, posture, dt):
            raise GeneratorExit

    law = Given(lambda rng: Closes())
    with pytest.raises(PartFailed, match=r"^controller 'odd': GeneratorExit$"):
        list(run(dataclasses.replace(load("still", SHORT), controller=law)))


def test_features_that_are_not_finite_are_named():
    class Lost(MomentFeatures):
        def values(self, sight):
            return super().values(sight) * np.nan

    odd = Given(lambda outline: Lost(Scaling.METRIC, 0.1))
    with pytest.raises(PartFailed) as failed:
        list(run(dataclasses.replace(load("still", SHORT), features=odd)))
    assert str(failed.value).startswith(
        "features 'odd': values returned [nan nan nan nan]; all must"
    )


def test_an_estimate_that_is_not_finite_is_named():
    class Lost(Nothing):
        def update(self, error, own, dt):
            return Prediction.unmeasured(error * np.nan, error)

    with pytest.raises(PartFailed) as failed:
        list(run(dataclasses.replace(load("still", SHORT), estimator=Given(lambda rng: Lost()))))
    assert str(failed.value) == (
        "estimator 'odd': update: Prediction.error is [nan nan nan nan]; it should be 4 finite numbers"
    )


def test_an_exception_of_the_estimator_is_its_own_though_the_law_calls_it():
    class Broken(Nothing):
        def update(self, error, own, dt):
            raise KeyError("gain")

    with pytest.raises(PartFailed, match=r"^estimator 'odd': KeyError: 'gain'$"):
        list(run(dataclasses.replace(load("still", SHORT), estimator=Given(lambda rng: Broken()))))


class Single(Still):
    """A tracker that reports numbers in single precision, as a network does."""

    def start(self, frame, region, state):
        check_region(frame, region, state)
        self.state = State(*np.float32([state.x, state.y, state.theta, state.scale]))

    def update(self, frame, ego=None):
        bright = frame.image.max() > 200
        status = Status.LOCKED if bright else Status.LOST
        return Estimate(self.state, unknown_covariance(), np.float32(0.5), status)


def test_the_loop_takes_single_precision_as_the_check_of_trackers_does():
    single = Given(lambda rng: Single())
    check_tracker(single)
    steps = list(run(dataclasses.replace(load("still", SHORT), tracker=single)))
    assert type(steps[-1].estimate.state.x) is np.float32
    assert len(steps) == 6


@dataclass(frozen=True)
class Backend:
    """A `Config` with a setting that happens to be called kind."""

    kind: str = "csrt"

    def build(self, rng):
        return type("Broken", (Still,), {"update": raises(RuntimeError("no weights"))})()


def test_a_setting_called_kind_does_not_rename_the_part():
    with pytest.raises(PartFailed) as failed:
        list(run(dataclasses.replace(load("still", SHORT), tracker=Backend())))
    assert str(failed.value) == (f"tracker '{__name__}:Backend': RuntimeError: no weights")


def test_a_run_that_failed_leaves_nothing_behind():
    def numbers():
        found = []
        for step in run(load("noise", ["run.duration=0.3", "estimator.kind=jump"], 5)):
            pixels = int(step.frame.image.sum(dtype=np.int64))
            found.append([pixels, *step.estimate.state.vector, *step.command.twist])
        return np.array(found)

    before = numbers()
    ends = {str(end): tracker(update=raises(end)) for end in (KeyboardInterrupt(), MemoryError())}
    for parts in (FAILURES | ends).values():
        with pytest.raises((Mistake, KeyboardInterrupt, MemoryError)):
            list(run(dataclasses.replace(load("noise", SHORT), **parts)))
    abandoned = run(load("noise", SHORT))
    next(abandoned)
    np.testing.assert_array_equal(numbers(), before)


def needing(place, needs):
    """A part whose `Config` declares these channels, and which can take them."""
    sees = type("Sees", (Still,), {"see": lambda self, view: None})
    config = type("Needing", (Given,), {"needs": needs})
    return {place: config(lambda rng: sees())}


@pytest.mark.parametrize(
    ("part", "message"),
    [
        (
            needing("tracker", frozenset({Channel.TRUE_MOTION, Channel.SEEN, Channel.TRUTH})),
            "still: tracker: its Config needs SEEN, TRUE_MOTION, which the tracker is not given; it "
            "can have DEPTH, EGO_MOTION, PICTURE, TRUTH",
        ),
        (
            needing("estimator", frozenset({Channel.EGO_MOTION})),
            "still: estimator: its Config needs EGO_MOTION, which the estimator is not given; it can "
            "have DEPTH, PICTURE, SEEN, TRUE_MOTION, TRUTH",
        ),
        (
            needing("tracker", {Channel.DEPTH}),
            "still: the Config of a component needs DEPTH, the depth picture, and there is none: set "
            "camera.depth = true, or give Frame.depth with a camera of your own",
        ),
        (
            needing("controller", "depth"),
            "still: controller: needs of its Config is 'depth', which is no set of servo.Channel "
            "members: give a frozenset of these",
        ),
        (
            needing("tracker", [Channel.DEPTH]),
            "still: tracker: needs of its Config is [<Channel.DEPTH: 'The depth picture of the "
            "camera.'>], which is no set of servo.Channel members: give a frozenset of these",
        ),
        (
            needing("tracker", {"DEPTH"}),
            "still: tracker: needs of its Config is {'DEPTH'}, which is no set of servo.Channel "
            "members: give a frozenset of these",
        ),
    ],
)
def test_data_that_a_component_is_not_given_is_refused(part, message):
    with pytest.raises(Mistake) as refused:
        list(run(dataclasses.replace(load("still", SHORT), **part)))
    assert str(refused.value) == message


def test_a_component_that_needs_what_only_see_delivers_has_this_method():
    part = type("Needing", (Given,), {"needs": {Channel.TRUTH}})
    blind = {"tracker": part(lambda rng: Still())}
    with pytest.raises(
        PartFailed, match=r"needs TRUTH, but it has no method see\(view\) to take that"
    ):
        list(run(dataclasses.replace(load("still", SHORT), **blind)))


def test_an_estimator_that_looks_at_pictures_leaves_the_features_alone():
    class Looks(Nothing):
        def see(self, view):
            pictures.append(view.picture)

    pictures = []
    config = type("Looking", (Given,), {"needs": frozenset({Channel.PICTURE})})
    scenario = load("still", [*SHORT, "start.x=20"])
    usual = list(run(scenario))
    steps = list(run(dataclasses.replace(scenario, estimator=config(lambda rng: Looks()))))
    assert np.linalg.norm(usual[0].command.twist) > 0.01
    np.testing.assert_array_equal(steps[0].command.twist, usual[0].command.twist)
    np.testing.assert_array_equal(pictures[0], steps[0].frame.image)


def test_a_controller_that_needs_the_true_motion_is_named():
    config = type("Knowing", (Given,), {"needs": frozenset({Channel.TRUE_MOTION})})
    sees = type("Seeing", (Sees,), {"see": lambda self, view: None})
    scenario = load("photometric", ["run.duration=0.2", "expect={}"])
    with pytest.raises(Mistake) as refused:
        list(run(dataclasses.replace(scenario, controller=config(lambda rng: sees()))))
    assert str(refused.value).startswith(
        "photometric: controller: this kind needs the target's true"
    )


@pytest.mark.parametrize(
    ("outline", "message"),
    [
        (raises(RuntimeError("no square")), "RuntimeError: no square"),
        (lambda self, *_: None, "outline returned None, which is not (Region, State)"),
    ],
)
def test_a_tracker_that_fails_to_find_the_outline_is_named(outline, message):
    with pytest.raises(PartFailed) as failed:
        list(run(dataclasses.replace(load("tag_still", SHORT), **tracker(outline=outline))))
    assert str(failed.value) == f"tracker 'odd': {message}"
