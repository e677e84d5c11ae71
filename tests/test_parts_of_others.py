"""Parts from outside: by entry point, by path, from Python; and what they may get wrong."""

import dataclasses
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

from servo.loop.episode import Episode, run
from servo.loop.part_failed import PartFailed
from servo.mistake import Mistake
from servo.output.versions import versions
from servo.scenario.load import load, parse
from servo.study.perform import perform
from servo.study.plan import Run
from servo.types import Command
from sim import installed, kinds
from sim.types import Pose
from tracking import create
from tracking.types import Estimate, State, Status, unknown_covariance

SHORT = ["run.duration=0.2", "estimator.kind=none", "expect={}"]
MODULE = '''"""A module of somebody."""

from dataclasses import dataclass

from tracking.trackers.frozen import Frozen


@dataclass(frozen=True)
class Config:
    """Stands still.

    It is a joke.
    """

    least: int = 3
    """A number."""

    def build(self, rng):
        return Frozen()


@dataclass(frozen=True)
class Bare:
    size: int

    def build(self, rng):
        return Frozen()


@dataclass(frozen=True)
class Other(Config):
    """Another one."""


class Plain:
    def build(self, rng):
        return Frozen()


VALUE = 3
'''


@pytest.fixture
def package(tmp_path, monkeypatch):
    """Makes an installed package with a module and kinds of trackers."""
    monkeypatch.syspath_prepend(tmp_path)
    installed.installed.cache_clear()

    def make(name, **kinds_of):
        module = name.replace("-", "_")
        (tmp_path / f"{module}.py").write_text(MODULE)
        info = tmp_path / f"{module}-1.5.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.5\n")
        lines = [f"{kind} = {module}:{of}" for kind, of in kinds_of.items()]
        (info / "entry_points.txt").write_text("\n".join(["[servobench.trackers]", *lines]))
        return module

    yield make
    installed.installed.cache_clear()


TRACKERS = "tracking.trackers"


def test_a_kind_of_an_installed_package_stands_beside_ours(package):
    package("pkg-a", calm="Config")
    assert "calm" in kinds.names(TRACKERS)
    assert kinds.package_of(TRACKERS, "calm") == "pkg-a 1.5"
    assert kinds.package_of(TRACKERS, "kams") == ""
    assert kinds.summary(TRACKERS, "calm") == "Stands still."
    scenario = load("still", ["tracker.kind=calm", "tracker.least=4"])
    assert scenario.settings()["tracker"] == {"kind": "calm", "least": 4}
    assert parse({"tracker": {"kind": "calm"}}, "a", "a.toml").tracker.least == 3
    assert versions()["pkg-a"] == "1.5"
    assert dataclasses.asdict(load("still", ["tracker.kind=pkg-a:calm"]).tracker) == {"least": 3}


def test_names_that_two_packages_use_are_written_with_the_package(package):
    package("pkg-a", calm="Config", kams="Other")
    package("pkg-b", calm="Config")
    names = kinds.names(TRACKERS)
    assert [n for n in names if "calm" in n or "kams" in n] == [
        "kams", "pkg-a:calm", "pkg-a:kams", "pkg-b:calm"]  # fmt: skip
    assert kinds.kind_of(load("still", ["tracker.kind=kams"]).tracker) == "kams"
    assert kinds.kind_of(load("still", ["tracker.kind=pkg-a:kams"]).tracker) == "pkg-a:kams"
    with pytest.raises(Mistake) as refused:
        parse({"tracker": {"kind": "calm"}}, "a", "a.toml")
    assert str(refused.value) == (
        "a.toml: tracker.kind: several packages have a kind 'calm': write pkg-a:calm or pkg-b:calm"
    )


@pytest.mark.parametrize(("of", "sentence"), [
    ("Bare", "'x': its settings size have no defaults"),
    ("Plain", "'x' has a method build(rng), but is no dataclass of settings"),
    ("VALUE", "'x' is no Config: that is a dataclass with a method build(rng)"),
    ("Nope", "the kind 'x' of pkg-a 1.5: 'pkg_a:Nope' cannot be imported: module 'pkg_a' has no "
             "attribute 'Nope'"),
])  # fmt: skip
def test_a_broken_kind_of_a_package_is_a_sentence(package, of, sentence):
    package("pkg-a", x=of)
    with pytest.raises(Mistake) as refused:
        load("still", ["tracker.kind=x"])
    assert str(refused.value) == f"--set tracker.kind=x: tracker.kind: {sentence}"


def test_a_path_is_taken_from_the_command_line_and_from_python_but_not_from_a_file(package):
    module = package("pkg-a")
    path = f"{module}:Config"
    scenario = load("still", [f"tracker.kind={path}", "tracker.least=9"])
    assert scenario.settings()["tracker"] == {"kind": path, "least": 9}
    assert type(create(path)).__name__ == "Frozen"
    with pytest.raises(Mistake) as refused:
        parse({"tracker": {"kind": path}}, "a", "a.toml")
    assert str(refused.value) == (
        f"a.toml: tracker.kind: '{path}' is no kind of an installed package, and a file may not "
        "name code to import: give it with --set, or from Python"
    )


def test_a_setting_may_be_kept_out_of_files(package):
    module = package("pkg-a", calm="Config")
    config = kinds.config_of(TRACKERS, "calm")
    config.not_from_file = ("least",)
    assert load("still", ["tracker.kind=calm"]).tracker.least == 3
    with pytest.raises(Mistake, match=r"a.toml: tracker.least: a file may not name a command to "):
        parse({"tracker": {"kind": "calm", "least": "4"}}, "a", "a.toml")
    assert module


def test_a_class_or_an_instance_from_python(package):
    package("pkg-a", calm="Config")
    config = kinds.config_of(TRACKERS, "calm")
    assert load("still", tracker=config).tracker == config()
    assert load("still", tracker=config(least=8)).tracker.least == 8
    with pytest.raises(Mistake, match=r"^there is no part 'tracer'; did you mean 'tracker'\?$"):
        load("still", tracer=config)
    with pytest.raises(Mistake, match="^motion: 'object' is no Config: "):
        load("still", motion=object)


def test_a_worker_that_lacks_a_package_is_named():
    run_ = Run(0, "still", 0, {}, {"tracker": {"kind": "calm"}}, "still.toml", pictured=False)
    with pytest.raises(Mistake) as failed:
        perform(run_)
    said = str(failed.value)
    assert said.startswith("the worker on ")
    assert " lacks a package: still.toml: tracker.kind: there is no kind 'calm'; there is " in said


def test_the_old_name_of_the_second_target_says_the_new_one():
    with pytest.raises(Mistake) as refused:
        parse({"disturbances": [{"kind": "second_car"}]}, "a", "a.toml")
    assert str(refused.value) == (
        "a.toml: disturbances[0]: the kind 'second_car' of version 0.1 is called second_target now"
    )


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
    "tracker 'odd': update returned x = nan, y = 1, theta = 0, scale = 1, distance = 0; all must "
    "be finite, and the scale above 0": tracker(
        lambda e: dataclasses.replace(e, state=State(float("nan"), 1.0))),
    "tracker 'odd': update returned x = 1, y = 1, theta = 0, scale = -1, distance = 0; all must "
    "be finite, and the scale above 0": tracker(
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
    with pytest.raises(PartFailed, match="^controller 'odd': ZeroDivisionError") as failed:
        list(run(scenario))
    assert isinstance(failed.value.__cause__, ZeroDivisionError)


@pytest.mark.parametrize("part", ["features", "estimator"])
def test_numbers_that_are_not_finite_are_their_parts(part, monkeypatch):
    with Episode(load("still", SHORT)) as episode:
        if part == "features":
            found = episode.loop.features.values
            monkeypatch.setattr(type(episode.loop.features), "values",
                                lambda self, sight: found(sight) * np.nan)  # fmt: skip
        else:
            monkeypatch.setattr(type(episode.loop._estimator), "update", lambda self, e, own, dt: (
                dataclasses.replace(self.skip(own, dt), error=e * np.nan)))  # fmt: skip
        with pytest.raises(PartFailed, match=rf"^{part} '(moments|none)': gave the values \[nan"):
            list(episode)
