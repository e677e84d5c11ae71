"""Files that scenarios and studies name: found beside them, and known by what is in them."""

from pathlib import Path

import pytest

from servo.mistake import Mistake
from servo.scenario.load import load
from servo.scenario.named_files import MISSING, digest_of, digests, found_beside
from servo.study.files import StudyFile
from servo.study.parse import load as load_study
from servo.study.sequence_run import Contender
from servo.study.store import opened
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
        "target": {"file": "wedge.obj", "kind": "wedge.obj"},
        "tracker": {"model": ["wedge.obj", "other.onnx"]},
        "axes": {"target.file": ["wedge.obj", "duck"], "camera": {"calibration": "no\0name"}},
    }
    assert found_beside(table, folder) == {
        "target": {"file": whole, "kind": "wedge.obj"},
        "tracker": {"model": [whole, "other.onnx"]},
        "axes": {"target.file": [whole, "duck"], "camera": {"calibration": "no\0name"}},
    }
    assert load(str(folder / "mine.toml")).target.file == whole


def test_a_digest_follows_the_content_of_a_file_and_of_what_a_model_consists_of(folder):
    names = [str(folder / name) for name in ("wedge.obj", "model.xml")]
    table = {"target": {"file": names[0]}, "robot": {"model": names[1], "camera": "eye"}}
    before = digests(table)
    assert list(before) == names
    assert len(set(before.values())) == 2
    Path(names[0]).write_text(WEDGE.format(height=0.7))
    after = digests(table)
    assert all(before[name] != after[name] for name in names)
    Path(names[0]).write_text(WEDGE.format(height=0.4))
    assert digests(table) == before


@pytest.mark.parametrize("name", ["none.obj", "", ".", "a\0b", "/dev/null", "broken.xml"])
def test_what_is_no_file_has_no_digest(folder, name):
    (folder / "broken.xml").mkdir()
    assert digest_of(str(folder / name) if name == "broken.xml" else name) == MISSING
    assert digests({"file": name}) == {}


def test_a_study_does_not_go_on_after_a_file_that_it_names_has_changed(folder):
    def begin():
        study = load_study(str(folder / "study.toml"))
        with opened(folder / "out", StudyFile.of(study, "")):
            return study

    assert list(begin().files) == [str(folder / "wedge.obj")]
    begin()
    (folder / "wedge.obj").write_text(WEDGE.format(height=0.7))
    with pytest.raises(Mistake, match=r"holds another study \(its files differs\)"):
        begin()


def test_a_worker_with_another_file_is_refused(folder):
    run = next(load_study(str(folder / "study.toml")).jobs())
    (folder / "wedge.obj").write_text(WEDGE.format(height=0.7))
    with pytest.raises(Mistake) as refused:
        run.run(folder)
    assert str(refused.value).startswith("on ")
    said = f", the file {folder / 'wedge.obj'} is not the one that the study began with"
    assert str(refused.value).endswith(said)


def test_a_bench_knows_the_model_files_of_a_tracker(folder):
    path = str(folder / "net.onnx")
    contender = Contender("mine", opencv.Config(name="Vit", model=path))
    assert "files" not in contender.describe()
    Path(path).write_bytes(b"net")
    assert contender.describe()["files"] == {path: digest_of(path)}
