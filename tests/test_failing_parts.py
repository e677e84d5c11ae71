"""A part that raises, or gives what has no meaning, is named in one sentence."""

import dataclasses
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

from servo.loop.episode import Episode, run
from servo.loop.part_failed import PartFailed
from servo.mistake import Mistake
from servo.scenario.load import load
from servo.types import Command
from sim.types import Pose
from tracking.types import Estimate, State, Status, unknown_covariance

SHORT = ["run.duration=0.2", "estimator.kind=none", "expect={}"]


@dataclass(frozen=True)
class Given:
    """A `Config` that builds what it was given."""

    make: object
    kind: str = "odd"

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
    none = {"start": lambda task: None, "aim": lambda goal: None}
    return {"controller": Given(lambda rng: SimpleNamespace(**none, command=lambda *a: command))}


def at(pose):
    return {"motion": Given(lambda rng: SimpleNamespace(at=lambda t: pose(t)))}


HEIGHT = np.array([0.0, 0.0, 0.0])
FAILURES = {
    "tracker 'odd': RuntimeError: no weights": tracker(start=raises(RuntimeError("no weights"))),
    "tracker 'odd': KeyError: 'x'": tracker(update=raises(KeyError("x"))),
    "tracker 'odd': the network gave nothing": tracker(
        update=raises(ValueError("the network gave nothing"))),
    "tracker 'odd': update returned NoneType instead of an Estimate": tracker(lambda e: None),
    "tracker 'odd': update returned x = nan, y = 1.0, theta = 0.0, scale = 1.0, distance = 0.0; "
    "all must be finite numbers, and the scale above 0": tracker(
        lambda e: dataclasses.replace(e, state=State(float("nan"), 1.0))),
    "tracker 'odd': update returned x = 1.0, y = 1.0, theta = 0.0, scale = -1.0, distance = 0.0; "
    "all must be finite numbers, and the scale above 0": tracker(
        lambda e: dataclasses.replace(e, state=State(1.0, 1.0, 0.0, -1.0))),
    "tracker 'odd': update returned the status 'LOST'": tracker(
        lambda e: dataclasses.replace(e, status="LOST")),
    "tracker 'odd': update returned corners that are not four points (4, 2) of finite numbers":
        tracker(lambda e: dataclasses.replace(e, corners=np.full((4, 2), np.nan))),
    "controller 'odd': command returned list instead of a Command": controller([0.0] * 6),
    "controller 'odd': the twist is [nan  0.  0.  0.  0.  0.]; it should be six finite numbers":
        controller(Command(np.array([np.nan, 0, 0, 0, 0, 0]))),
    "controller 'odd': the twist is [0. 0. 0.]; it should be six finite numbers":
        controller(Command(np.zeros(3))),
    "motion 'odd': the target's position is [ 0. nan  0.], its rotation ": at(
        lambda t: Pose(np.eye(3), HEIGHT if t < 0.05 else np.array([0.0, np.nan, 0.0]))),
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

    def aim(self, goal):
        pass

    def command(self, seen, posture, dt):
        return 1 // 0


def test_parts_that_share_a_module_are_told_apart():
    parts = {"tracker": Given(lambda rng: Still()), "controller": Given(lambda rng: Sees())}
    scenario = dataclasses.replace(load("still", SHORT), **parts)
    with pytest.raises(PartFailed, match=r"^controller 'odd': ZeroDivisionError") as failed:
        list(run(scenario))
    assert isinstance(failed.value.__cause__, ZeroDivisionError)


@pytest.mark.parametrize("part", ["features", "estimator"])
def test_numbers_that_are_not_finite_are_their_parts(part, monkeypatch):
    with Episode(load("still", SHORT)) as episode:
        if part == "features":
            found = episode.loop.features.values
            monkeypatch.setattr(
                type(episode.loop.features), "values", lambda self, sight: found(sight) * np.nan
            )
        else:
            monkeypatch.setattr(
                type(episode.loop._estimator),
                "update",
                lambda self, e, own, dt: dataclasses.replace(self.skip(own, dt), error=e * np.nan),
            )
        with pytest.raises(PartFailed, match=rf"^{part} '(moments|none)': gave the values \[nan"):
            list(episode)
