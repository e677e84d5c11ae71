"""Files that scenarios and studies name: found beside them, and known by what is in them."""

from dataclasses import replace
from pathlib import Path

import pytest

from servo.mistake import Mistake
from servo.scenario.load import load
from servo.scenario.named_files import (
    MISSING,
    digest_of,
    digests,
    found_beside,
    named_by,
    named_in,
)
from servo.study.execute import Workers
from servo.study.parse import load as load_study
from servo.study.run import Job
from servo.study.scenario_run import StudiedScenario
from servo.study.sequence_run import Contender
from servo.study.store import StudyFile, opened
from servo.study.trials import Trials, trial_study
from sim.installed import entries
from tracking.trackers import opencv

WEDGE = """v -1 -.5 0\nv 1 -.5 0\nv 1 .5 0\nv -1 .5 0\nv -1 -.5 {height}\nv -1 .5 {height}
f 1 4 3 2\nf 1 2 5\nf 4 6 3\nf 1 5 6 4\nf 2 3 6 5\n"""
MODEL = """<mujoco><asset><mesh name="m" file="wedge.obj"/></asset>
<worldbody><geom type="mesh" mesh="m"/></worldbody></mujoco>"""
SCENARIO = '[run]\nduration = 0.1\n[target]\nkind = "mesh"\nfile = "wedge.obj"\n'
STUDY = 'scenario = "mine.toml"\nseeds = 1\n[axes]\n"target.size" = [0.1, 0.12]\n'


@pytest.fixture
def folder(tmp_path, monkeypatch):
    place = tmp_path / "parts"
    place.mkdir()
    (place / "wedge.obj").write_text(WEDGE.format(height=0.4))
    (place / "model.xml").write_text(MODEL)
    (place / "mine.toml").write_text(SCENARIO)
    (place / "study.toml").write_text(STUDY)
    monkeypatch.chdir(tmp_path)
    return place


def test_files_are_looked_for_beside_the_file_that_names_them(folder):
    whole = str(folder / "wedge.obj")
    table = {
        "target": {"kind": "mesh", "file": "wedge.obj", "colour": "wedge.obj"},
        "tracker": {"kind": "opencv", "model": ["wedge.obj", "other.onnx"], "name": "wedge.obj"},
        "camera": {"calibration": "no\0name"},
        "motion": {"file": "wedge.obj"},
        "vary": {"target.file": {"choice": ["wedge.obj", "duck"]}},
    }
    assert found_beside(table, folder) == {
        "target": {"kind": "mesh", "file": whole, "colour": "wedge.obj"},
        "tracker": {"kind": "opencv", "model": [whole, "other.onnx"], "name": "wedge.obj"},
        "camera": {"calibration": "no\0name"},
        "motion": {"file": "wedge.obj"},
        "vary": {"target.file": {"choice": [whole, "duck"]}},
    }
    assert load(str(folder / "mine.toml")).target.file == whole


def test_a_study_finds_files_of_the_kinds_of_its_scenarios(folder):
    whole = str(folder / "wedge.obj")
    study = {
        "set": {"target.file": "wedge.obj"},
        "named": {"shape.of": {"low.one": {"target.file": "wedge.obj", "run.duration": 3}}},
    }
    assert found_beside(study, folder) == study  # the default target is a car
    found = found_beside(study, folder, {"target": {"kind": "mesh"}})
    assert found["set"] == {"target.file": whole}
    assert found["named"]["shape.of"]["low.one"] == {"target.file": whole, "run.duration": 3}


PLUGIN = """'''A tracker of somebody.'''
from dataclasses import dataclass

from sim.ranges import File


@dataclass(frozen=True)
class Config:
    model: str = "resnet"
    weights: File | None = None

    def build(self, rng):
        raise NotImplementedError
"""


def test_the_types_of_a_plugin_say_which_of_its_settings_name_files(folder, monkeypatch):
    monkeypatch.syspath_prepend(folder)
    (folder / "net_of_mine.py").write_text(PLUGIN)
    info = folder / "net_of_mine-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: net-of-mine\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[servobench.trackers]\nnet = net_of_mine:Config\n")
    for name in ("resnet", "net.pt"):
        (folder / name).write_text("numbers")
    (folder / "net.toml").write_text('[tracker]\nkind = "net"\nweights = "net.pt"\n')
    (folder / "nets.toml").write_text(
        'scenario = "net.toml"\nset = {run.duration = 0.1}\n'
        '[axes]\ntracker.model = ["resnet", "alexnet"]\ntracker.weights = ["net.pt"]\n'
    )
    entries.cache_clear()
    try:
        tracker = load(str(folder / "net.toml"), ["tracker.model=resnet"]).tracker
        weights = str(folder / "net.pt")
        assert (tracker.model, tracker.weights) == ("resnet", weights)
        assert digests(named_by(tracker)) == {weights: digest_of(weights)}
        study = load_study(str(folder / "nets.toml"))
        assert study.files == {weights: digest_of(weights)}
        assert [axis.values for axis in study.axes] == [("resnet", "alexnet"), (weights,)]
        given = load(str(folder / "net.toml"), ["tracker.weights=net.pt"]).tracker.weights
        assert given == "net.pt"  # of the working directory
    finally:
        entries.cache_clear()


def test_a_digest_follows_the_content_of_a_file_and_of_what_a_model_consists_of(folder):
    names = [str(folder / name) for name in ("wedge.obj", "model.xml")]
    target = {"kind": "mesh", "file": names[0]}
    table = {"target": target, "robot": {"kind": "mjcf", "model": names[1], "camera": "eye"}}
    assert named_in(table) == names
    before = digests(names)
    assert list(before) == names
    assert len(set(before.values())) == 2
    Path(names[0]).write_text(WEDGE.format(height=0.7))
    after = digests(names)
    assert all(before[name] != after[name] for name in names)
    Path(names[0]).write_text(WEDGE.format(height=0.4))
    assert digests(names) == before


@pytest.mark.usefixtures("folder")
def test_a_trial_whose_file_has_changed_is_made_again(tmp_path):
    other = tmp_path / "other.obj"
    other.write_text(WEDGE.format(height=0.4))
    base, described = trial_study("tune", "parts/mine.toml", [], "servobench tune")
    asked = [({"target.file": str(other)}, 0)]
    with opened(tmp_path / "out", described) as store, Workers(1) as workers:
        store.find()
        do = Trials(base, store, workers, lambda _: None)
        do(asked)
        do(asked)
        assert len(store.done) == 1
        other.write_text(WEDGE.format(height=0.5))
        do(asked)
        assert len(store.done) == 2


def test_a_job_is_another_one_with_other_groups_of_settings_or_files():
    base = StudiedScenario("still", {}, "still.toml")
    slow = replace(base, named={"speed": {"slow": {"controller.gain": 0.5}}})
    slower = replace(base, named={"speed": {"slow": {"controller.gain": 0.1}}})
    other = replace(slower, files={"a.obj": "0123456789ab"})
    assert len({Job(0, one, 0, {"speed": "slow"}).digest for one in (slow, slower, other)}) == 3


@pytest.mark.parametrize("name", ["none.obj", "", "a\0b", "/dev/null", "broken.xml"])
def test_what_is_no_file_has_no_digest(folder, name):
    (folder / "broken.xml").mkdir()
    assert digest_of(str(folder / name) if name == "broken.xml" else name) == MISSING
    assert digests([name]) == {}


def test_a_study_does_not_go_on_after_a_file_that_it_names_has_changed(folder):
    def begin():
        study = load_study(str(folder / "study.toml"))
        with opened(folder / "out", StudyFile.of(study, "")):
            return study

    assert list(begin().files) == [str(folder / "wedge.obj")]
    begin()
    (folder / "wedge.obj").write_text(WEDGE.format(height=0.7))
    with pytest.raises(Mistake, match=r"holds another study \(its files differ: \S*wedge.obj\)"):
        begin()


def test_a_worker_with_another_file_is_refused(folder):
    run = next(load_study(str(folder / "study.toml")).jobs())
    (folder / "wedge.obj").write_text(WEDGE.format(height=0.7))
    with pytest.raises(Mistake) as refused:
        run.run(folder)
    assert str(refused.value).startswith("on ")
    said = f", the file {folder / 'wedge.obj'} is missing or differs from the one at the start of the study: restore it, or copy it to that machine"
    assert str(refused.value).endswith(said)


def test_a_bench_knows_the_model_files_of_a_tracker(folder):
    path = str(folder / "net.onnx")
    contender = Contender("mine", opencv.Config(name="Vit", model=path))
    assert "files" not in contender.describe()
    Path(path).write_bytes(b"net")
    assert contender.describe()["files"] == {path: digest_of(path)}
