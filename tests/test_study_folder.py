"""The folder of a study: what does not fit its plan counts as not run, and nothing is mixed in."""

import json
import os
import resource
import shutil
import sys
from contextlib import contextmanager
from dataclasses import replace
from sqlite3 import Connection

import numpy as np
import pytest
from kept import drop, execute, spoil

from servo.cli import main
from servo.mistake import Mistake, Refused
from servo.output.versions import RENDERING, SOURCE
from servo.study import store
from servo.study.parse import load
from servo.study.run import Failure
from servo.study.scenario_run import TIMES
from servo.study.store import RUNS, StudyFile


@pytest.fixture
def small(study_place):
    return load("mine.toml")


@pytest.fixture
def folder(finished_study, study_place):
    shutil.copytree(finished_study, study_place / "out")
    return study_place / "out"


@contextmanager
def opened(study, folder, **changed):
    with store.opened(folder, replace(StudyFile.of(study, "me"), **changed)) as kept:
        kept.find(study.jobs())
        yield kept


def refused(study, folder, **changed):
    with pytest.raises(Mistake) as said, opened(study, folder, **changed):
        pass
    return str(said.value)


DAMAGE = {
    "another record": lambda f: spoil(f, 2),
    "a flipped bit": lambda f: spoil(f, 2, "series", flipped(content(f, 2, "series"), 200)),
    "another type": lambda f: spoil(f, 2, "record", b"text"),
    "bytes that are no text": lambda f: execute(
        f, "UPDATE runs SET record = CAST(X'FF' AS TEXT) WHERE key = '000002'"
    ),
    "nothing": lambda f: spoil(f, 2, "series", None),
    "another sheet": lambda f: spoil(f, 2, "sheet", b"a"),
    "another job": lambda f: spoil(f, 2, "job", "a"),
    "no row": lambda f: drop(f, 2),
}


def content(folder, number, column):
    return execute(folder, f"SELECT {column} FROM runs WHERE key = ?", f"{number:06}")[0][0]


def flipped(raw, at):
    return raw[:at] + bytes([raw[at] ^ 0x10]) + raw[at + 1 :]


@pytest.mark.parametrize("damage", DAMAGE)
def test_what_does_not_fit_the_plan_is_run_again(small, folder, damage):
    DAMAGE[damage](folder)
    with opened(small, folder) as kept:
        assert kept.done == {"000000", "000001", "000003"}
        assert kept.damaged == ([] if damage == "no row" else ["000002"])


@pytest.mark.wide
def test_no_flipped_bit_changes_what_is_read(small, folder):
    file = folder / RUNS
    raw = file.read_bytes()
    with opened(small, folder) as kept:
        before = {record.number: record.row for record in kept.read(kept.done)}
    detected = 0
    for at in np.random.default_rng(0).integers(len(raw), size=300).tolist():
        file.write_bytes(flipped(raw, at))
        there = store.Store(folder)
        try:
            there.find(small.jobs())
            found = {record.number: record.row for record in there.read(there.done)}
        except (Mistake, Refused):
            detected += 1
        else:
            assert found.items() <= before.items()
            detected += len(found) < 4
    assert detected > 100


@pytest.mark.parametrize("content", [bytes(5000), b"SQLite format 3" + bytes(5000), b"no"])
def test_a_file_that_is_no_database_is_one_sentence(small, folder, content, monkeypatch):
    opened_now = set()

    class Counted(store.sqlite3.Connection):
        def __init__(self, *words, **more):
            super().__init__(*words, **more)
            opened_now.add(self)

        def close(self):
            super().close()
            opened_now.discard(self)

    (folder / RUNS).write_bytes(content)
    connect = store.sqlite3.connect
    monkeypatch.setattr(
        store.sqlite3, "connect", lambda *words, **more: connect(*words, **more, factory=Counted)
    )
    assert refused(small, folder).startswith(f"{folder / RUNS}: this file is damaged (")
    with pytest.raises(Mistake, match="this file is damaged"):
        store.Store(folder).find()
    assert not opened_now


def test_a_folder_that_is_read_only_can_be_read(small, folder, monkeypatch):
    """Of an archive; the superuser, who may run this, is refused nothing, so these calls are."""
    connect = store.sqlite3.connect

    class ReadOnly(store.sqlite3.Connection):
        def execute(self, *words):
            raise store.sqlite3.OperationalError("unable to open database file")

    def refusing(place, **more):
        return connect(place, **more, factory=ReadOnly if place.endswith("mode=ro") else Connection)

    monkeypatch.setattr(store.sqlite3, "connect", refusing)
    monkeypatch.setattr(store.os, "access", lambda *_: False)
    there = store.Store(folder)
    there.find(small.jobs())
    assert len(there.done) == len(there.records(small.jobs())) == 4


def test_others_read_while_a_session_writes(small, folder, study_place):
    jobs = list(small.jobs())
    with opened(small, folder) as kept:
        records = kept.records(jobs)
    with opened(small, study_place / "other") as kept:
        reader = store.Store(study_place / "other")
        for count, (job, record) in enumerate(zip(jobs, records, strict=True), 1):
            kept.add(job, record)
            reader.find()
            assert len(reader.done) == count
    assert sorted(p.name for p in (study_place / "other").iterdir()) == [
        ".lock",
        "runs.sqlite",
        "study.json",
    ]


def test_a_file_system_without_shared_memory_is_enough(small, folder, study_place, monkeypatch):
    """As those of networks: SQLite then keeps its usual journal."""
    connect = store.sqlite3.connect

    class OfNetwork(Connection):
        def execute(self, statement, *more):
            if "WAL" in statement:
                raise store.sqlite3.OperationalError("locking protocol")
            return super().execute(statement, *more)

    monkeypatch.setattr(
        store.sqlite3, "connect", lambda place, **more: connect(place, **more, factory=OfNetwork)
    )
    with opened(small, folder) as kept:
        records = kept.records(small.jobs())
    with opened(small, study_place / "other") as kept:
        for job, record in zip(small.jobs(), records, strict=True):
            kept.add(job, record)
        assert not (study_place / "other" / f"{RUNS}-wal").exists()
    with opened(small, study_place / "other") as kept:
        assert len(kept.done) == 4


def test_a_whole_folder_is_complete(small, folder):
    with opened(small, folder) as kept:
        assert (len(kept.done), kept.damaged) == (4, [])


def call(monkeypatch, capfd, *arguments):
    monkeypatch.setattr(sys, "argv", ["servobench", *arguments])
    with pytest.raises(SystemExit) as ended:
        main.main()
    out, err = capfd.readouterr()
    return ended.value.code or 0, out, err


def untimed(folder):
    there = store.Store(folder)
    there.find()
    (record,) = there.read(["000002"])
    return {name: value for name, value in record.row.items() if name not in TIMES}


@pytest.mark.usefixtures("no_workers")
def test_the_command_says_what_it_runs_again_and_ends_with_the_same_numbers(
    monkeypatch, capfd, folder
):
    before = untimed(folder)
    spoil(folder, 2)
    code, _, err = call(monkeypatch, capfd, "sweep", "mine.toml", "--out", "out")
    assert (code, err) == (
        0,
        "servobench: out/runs.sqlite: damaged records, or records of other runs: 1, the first that of "
        "run 000002; these runs are done again\n",
    )
    assert untimed(folder) == before


@pytest.mark.parametrize("order", [1, -1])
def test_records_are_read_as_they_were_added_in_whatever_order(small, folder, order, study_place):
    jobs = list(small.jobs())
    with opened(small, folder) as kept:
        whole = kept.table()
        records = kept.records(jobs)
    with opened(small, study_place / "other") as kept:
        for job, record in list(zip(jobs, records, strict=True))[::order]:
            kept.add(job, record)
        assert kept.table().equals(whole)
        for before, after in zip(records, kept.records(jobs), strict=True):
            assert before.sheet == after.sheet
            np.testing.assert_equal(before.series, after.series)


def test_a_record_that_is_forgotten_and_done_again_replaces_the_old_one(small, folder):
    with opened(small, folder) as kept:
        job = list(small.jobs())[1]
        (record,) = kept.records([job])
        kept.forget(job)
        assert job.key not in kept.done
        kept.add(job, replace(record, outcome="again"))
        assert kept.table()["outcome"].to_pylist()[1] == "again"
        assert len(kept.done) == 4


def test_a_folder_with_a_file_for_every_failure_would_grow_without_end(monkeypatch, small, folder):
    monkeypatch.setattr(store, "MOST_FAILURES", 2)
    with opened(small, folder) as kept:
        for job in small.jobs():
            kept.fail(job, Failure("Traceback: no"))
        first = next(small.jobs())
        kept.fail(first, Failure("Traceback: still not"))
        assert sorted(p.name for p in (folder / "failures").iterdir()) == [
            "000000.json",
            "000001.json",
        ]
        assert "still not" in kept.failure_path(first).read_text()


def test_a_folder_of_the_first_format_is_refused_in_a_sentence(small, folder):
    about = json.loads((folder / "study.json").read_text())
    (folder / "study.json").write_text(json.dumps(about | {"format": 1}))
    assert refused(small, folder) == (
        f"{folder}/study.json: this file has format 1, and this version of servobench reads format "
        "2, so the runs in this folder cannot be used; choose another folder with --out"
    )


def test_runs_without_their_description_are_refused(small, folder):
    (folder / "study.json").unlink()
    assert refused(small, folder) == (
        f"{folder}: this folder has files, but no study.json of `servobench sweep`; "
        "choose another folder with --out"
    )


@pytest.mark.parametrize("text", ["", "null", "3", "[]", '"x"', "{", "\0", "[" * 100_000])
def test_a_damaged_description_is_refused(small, folder, text):
    (folder / "study.json").write_text(text)
    assert refused(small, folder) == (
        f"{folder}/study.json: this file is damaged, so the results beside it cannot be "
        "identified; choose another folder with --out"
    )


@pytest.mark.parametrize("versions", [None, [], {}, {"mujoco": None}, {"mujoco": "4"}, "x", 3])
def test_a_description_without_versions_is_refused(small, folder, versions):
    about = json.loads((folder / "study.json").read_text()) | {"versions": versions}
    (folder / "study.json").write_text(json.dumps(about))
    other = "these results state no version of servobench, and 0.1.0 is installed now: numbers may"
    damaged = "this file is damaged, so the results beside it cannot be identified"
    assert (other if versions in ({}, {"mujoco": "4"}) else damaged) in refused(small, folder)


def test_another_study_other_versions_and_other_code_are_refused(small, folder):
    assert refused(small, folder, seeds=[0]) == (
        f"{folder}: this folder holds another study (its seeds differ); choose another folder "
        "with --out"
    )
    versions = StudyFile.of(small, "me").versions
    assert refused(small, folder, versions=versions | {RENDERING: "otherwise"}) == (
        f"{folder}: the pictures of these results are '{versions[RENDERING]}', and now they would "
        "be 'otherwise': numbers may differ; choose another folder with --out"
    )
    assert refused(small, folder, versions=versions | {"mujoco": "9.9"}) == (
        f"{folder}: these results are of mujoco {versions['mujoco']}, and 9.9 is installed now: "
        "numbers may differ; choose another folder with --out"
    )
    assert refused(small, folder, versions=versions | {SOURCE: "0"}) == (
        f"{folder}: these results are of a source of servobench with digest {versions[SOURCE]}, "
        "and it is 0 now: numbers may differ; choose another folder with --out"
    )


@pytest.mark.parametrize(
    ("name", "there", "sentence"),
    [
        (
            SOURCE,
            "abc",
            "the source of servobench on a worker has digest abc, and here it has {here}: numbers "
            "may differ; install the same source on every worker",
        ),
        (
            RENDERING,
            "otherwise",
            "the pictures of a worker are 'otherwise', and here they are '{here}': numbers may "
            'differ; install OpenGL on every worker and here, or set camera.renderer = "exact"',
        ),
        (
            "mujoco",
            "9.9",
            "a worker has mujoco 9.9, and {here} is installed here: numbers may differ; install "
            "the same version on every worker",
        ),
        (
            "mujoco",
            None,
            "a worker lacks mujoco, and {here} is installed here: numbers may differ; install the "
            "same version on every worker",
        ),
    ],
)
def test_a_row_of_a_worker_with_other_versions_is_refused(small, folder, name, there, sentence):
    job = next(small.jobs())
    record = job.run(folder)
    versions = {k: v for k, v in record.versions.items() if k != name}
    versions |= {} if there is None else {name: there}
    with opened(small, folder) as kept, pytest.raises(Mistake) as said:
        kept.add(job, replace(record, versions=versions))
    assert str(said.value) == sentence.format(here=record.versions[name])


def test_a_folder_of_something_else_is_refused_and_left_alone(small, study_place):
    (study_place / "notes").mkdir()
    (study_place / "notes" / "thesis.txt").write_text("mine")
    assert "this folder has files, but no study.json" in refused(small, study_place / "notes")
    assert sorted(p.name for p in (study_place / "notes").iterdir()) == ["thesis.txt"]


def test_a_sweep_that_was_killed_at_once_goes_on(small, study_place):
    (study_place / "out").mkdir()
    (study_place / "out" / ".study.json.part").write_text("{")
    with opened(small, study_place / "out") as kept:
        assert kept.done == set()


def test_two_sweeps_do_not_write_into_one_folder(small, folder):
    with opened(small, folder):
        assert (
            refused(small, folder)
            == f"{folder}: another command is writing into this folder: wait for its end, or choose another folder with --out"
        )
    with opened(small, folder):
        pass


def test_a_full_disk_is_one_sentence_and_leaves_what_there_is(small, folder):
    job = next(small.jobs())
    record = job.run(folder)
    large = replace(record, series={"time_s": np.zeros(100_000)})
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    with opened(small, folder) as kept:
        try:
            resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, limits[1]))
            with pytest.raises(Refused) as said:
                kept.add(job, large)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert str(said.value).startswith(f"{folder}: cannot write run 000000: d")
    assert str(said.value).endswith(
        "; the finished runs are stored; remove the cause and run the same command again to "
        "continue"
    )
    with opened(small, folder) as kept:
        assert len(kept.done) == 4


def test_a_folder_that_cannot_be_made_is_one_sentence(small, study_place):
    (study_place / "file").write_text("")
    assert refused(small, study_place / "file" / "out") == (
        f"{study_place}/file/out: cannot write to this folder: Not a directory; choose another place"
    )


def test_a_pipe_in_place_of_the_runs_is_not_waited_for(small, folder):
    """Reading a pipe that nobody writes to would never end."""
    (folder / RUNS).unlink()
    os.mkfifo(folder / RUNS)
    there = store.Store(folder)
    there.find(small.jobs())
    assert there.done == set()
    with pytest.raises(Refused, match=r"cannot write runs\.sqlite: "), opened(small, folder):
        pass
