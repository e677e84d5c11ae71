"""Every file format: read as it was written, refused with another number; and its command."""

import json
import math
import os
import re
import shlex
import sys
from dataclasses import replace
from html import unescape
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from servo.cli import main
from servo.cli.report_command import write
from servo.mistake import Mistake
from servo.output.track_folder import TrackReport
from servo.papers.claim import Rule
from servo.papers.claims import Judged, PapersReport
from servo.study.bounds import MissedBound
from servo.study.run_report import RunReport
from servo.study.store import FailureFile, StudyFile
from tracking.evaluation import track_file
from tracking.files.json_text import as_json, json_text

MADE = {"command": "servobench run 'a b'", "versions": {"servobench": "0.1.0"}}
FILES = [
    RunReport(
        **MADE, scenario="still", seed=3, outcome="CONVERGED", measures={"a": 1.5, "b": None},
        units={"a": "px"}, expect={"a": 1.0, "outcome": "CONVERGED"},
        missed=[MissedBound("a", 1.5, 1.0), MissedBound("b", None, 1.0), MissedBound("c", "x", "y")],
        features={"xn": "m"}, feed_forward=["xn"], settings={"run": {"seed": 3}}, table={},
    ),
    TrackReport(
        **MADE, source="ü.mp4", tracker={"kind": "kams"}, seed=1, frames=2, undecodable=["0.png"],
        lost=1, measures={"auc": 0.1}, units={"auc": ""},
    ),
    PapersReport(**MADE, quick=True, claims={
        "P1-1": Judged(
            "s", Rule(*"msumth"), "holds", 1.0, None, 2.0, "px", 3, "m", [["a"]], ["f.png"]
        )
    }),
    StudyFile(
        **MADE, name="n", title="t", axes={"a": [1, 2.5, "x", True]}, draws={"b": {"normal": [0]}},
        seeds=[0], compare=None, expect={"a": 1.0}, runs=4, table={"t": [1]}, scenarios={"s": {}},
    ),
    FailureFile(run=1, settings={"a": 1}, command="servobench run x", error="Traceback"),
]  # fmt: skip


def named(file):
    return type(file).__name__


@pytest.mark.parametrize("file", FILES, ids=named)
def test_a_file_is_read_as_it_was_written(file, tmp_path):
    path = file.write(tmp_path, "file.json")
    assert type(file).read(path) == file
    assert json.loads(path.read_text())["format"] == file.FORMAT


@pytest.mark.parametrize("number", [None, 0, 3, "1", True, [1]])
@pytest.mark.parametrize("file", FILES, ids=named)
def test_another_format_number_is_one_sentence(file, number, tmp_path):
    path = file.write(tmp_path, "file.json")
    path.write_text(json.dumps(json.loads(path.read_text()) | {"format": number}))
    has = "has no format number" if number is None else f"has format {number!r}"
    with pytest.raises(Mistake) as told:
        type(file).read(path)
    assert str(told.value) == (
        f"{path}: this file {has}, and this version of servobench reads format {file.FORMAT}: repeat "
        "the command that wrote it, into a new folder, or read it with the version that "
        "wrote it"
    )


@pytest.mark.parametrize("file", FILES, ids=named)
def test_keys_that_are_unknown_pass_and_missing_ones_do_not(file, tmp_path):
    path = file.write(tmp_path, "file.json")
    document = json.loads(path.read_text())
    path.write_text(json.dumps(document | {"colour": "red"}))
    assert type(file).read(path) == file
    missing = list(document)[2]
    path.write_text(json.dumps({k: v for k, v in document.items() if k != missing}))
    with pytest.raises(
        Mistake,
        match=rf"file\.json: the content of this file is wrong: {missing}: field required; repeat ",
    ):
        type(file).read(path)


def test_a_file_of_another_kind_is_refused(tmp_path):
    path = FILES[1].write(tmp_path)
    with pytest.raises(
        Mistake,
        match=r"json: this file describes a 'track', but the file of a 'run' is needed: name another file$",
    ):
        RunReport.read(path)


def test_numbers_that_are_not_finite_are_null_and_half_characters_are_replaced(tmp_path):
    values = {"a": math.inf, "b": {"c": [math.nan, -math.inf, 1e-300]}}
    file = replace(FILES[-1], settings=values, error="caf\udce9")
    read = FailureFile.read(file.write(tmp_path, "file.json"))
    assert read.settings == {"a": None, "b": {"c": [None, None, 1e-300]}}
    assert read.error == "caf?"


def test_a_table_of_steps_has_its_format_number(ran, tmp_path):
    path = tmp_path / "steps.parquet"
    table = pq.read_table(ran / "steps.parquet")
    assert table.schema.metadata[b"format"] == b"1"
    (tmp_path / "report.json").write_bytes((ran / "report.json").read_bytes())
    for metadata, has in (({}, "no format number"), ({"format": "2"}, "format 2")):
        pq.write_table(table.replace_schema_metadata(metadata), path)
        with pytest.raises(Mistake, match=rf"steps\.parquet: this file has {has}, and this vers"):
            write([tmp_path], tmp_path / "page.html")


def test_the_stream_of_a_run_has_the_format_number_too(tmp_path):
    from servo.loop.episode import Episode
    from servo.output.steps_table import STREAM, StepsTable
    from servo.scenario.load import load

    with Episode(load("still", ["run.duration=0.1", "tracker.kind=frozen"])) as episode:
        table = StepsTable(tmp_path, episode)
    with pa.ipc.open_stream(str(tmp_path / STREAM)) as stream:
        assert stream.schema.metadata == {b"format": b"1"}
    table.close()


def test_an_older_track_is_named_by_its_columns(tmp_path):
    path = tmp_path / "track.csv"
    path.write_text("frame,x,y\n0,1,2\n")
    with pytest.raises(ValueError, match="not have the columns of a track") as told:
        track_file.read(path)
    assert str(told.value) == (
        f"{path}: this file does not have the columns of a track of format 3, which this version "
        "reads, but frame, x, y; run `servobench track` again with this version"
    )


def call(monkeypatch, words):
    monkeypatch.setattr(sys, "argv", words)
    with pytest.raises(SystemExit):
        main.main()


MINE = """[run]
duration = 0.2

[tracker]
kind = "frozen"

[[disturbances]]
kind = "brightness"
factor = 0.5
"""
COMMANDS = {
    "run": ("run mine.toml --set run.duration=0.1 --seed 4 --no-rerun", "steps.parquet"),
    "evaluate": ("evaluate clutter --trackers frozen --seeds 1", "runs.csv"),
    "closed_loop": ("evaluate closed_loop --trackers frozen --seeds 1", "results.parquet"),
    "papers": ("papers P1-3 --quick", "papers.json"),
    "sweep": ("sweep study.toml --set camera.rate=20.0 --seeds 1", "results.parquet"),
}
STUDY = """# study
# Two runs.
scenario = "still"

[set]
run.duration = 0.1
tracker.kind = "frozen"

[axes]
run.latency = [0, 1]
"""


@pytest.mark.wide
@pytest.mark.usefixtures("no_workers", "undrawn")
@pytest.mark.parametrize("kind", COMMANDS)
def test_the_page_of_each_folder_shows_the_stored_command(kind, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").write_text(MINE)
    (tmp_path / "study.toml").write_text(STUDY)
    line, _ = COMMANDS[kind]
    workers = [] if kind == "run" else ["--workers", "1"]
    call(monkeypatch, ["servobench", *line.split(), *workers, "--out", "out", "-q"])
    page = write([tmp_path / "out"], tmp_path / "page.html")[0].read_text()
    assert unescape(re.findall("<code>(.*)</code>", page)[-1]) == f"servobench {line}"
    if kind == "run":
        again = json.loads((tmp_path / "out" / "report.json").read_text())["command"]
        call(monkeypatch, [*shlex.split(again), "--out", "again", "-q"])
        first, second = (pq.read_table(tmp_path / f / "steps.parquet") for f in ("out", "again"))
        for name in first.column_names:
            if not name.startswith("seconds_"):
                np.testing.assert_array_equal(first[name].to_numpy(), second[name].to_numpy())


@pytest.mark.wide
def test_the_scenario_on_the_page_repeats_the_run_as_well(monkeypatch, tmp_path):
    from servo.scenario import load as scenarios

    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").write_text(MINE)
    changes = ["tracker.kind=kams", "tracker.gamma=2.0", "disturbances.0.factor=0.8"]
    sets = [word for change in changes for word in ("--set", change)]
    call(monkeypatch, ["servobench", "run", "mine.toml", *sets, "--out", "out", "-q"])
    page = write([tmp_path / "out"], tmp_path / "page.html")[0].read_text()
    text = unescape(re.findall("<code>(.*?)</code>", page, re.DOTALL)[0])
    (tmp_path / "kept.toml").write_text(text)
    assert scenarios.load("kept.toml").settings() == scenarios.load("mine.toml", changes).settings()


def test_a_report_of_a_part_from_python_names_it(tmp_path):
    from elsewhere import MyConfig
    from measured import measured_run

    from servo.scenario.load import load
    from servo.study.run import Job
    from servo.study.scenario_run import LoadedScenario, record_of

    scenario = replace(load("still", ["run.duration=0.1"]), tracker=MyConfig(gain=2.0))
    steps, _ = measured_run(scenario)
    job = Job(0, LoadedScenario(scenario), 0)
    found = RunReport.of(record_of(job, scenario, steps), scenario, steps[0].scene)
    assert found.settings["tracker"] == {"kind": "elsewhere:MyConfig", "gain": 2.0}
    assert as_json(found.settings) == found.settings


def test_a_path_that_is_no_text_can_be_written():
    found = json_text({"path": Path(os.fsdecode(b"a\xff"))})
    assert json.loads(found.encode()) == {"path": "a?"}
