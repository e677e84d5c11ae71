"""The folder of a study: what does not fit its plan counts as not run, and nothing is mixed in."""

import json
import os
import shutil
import sys
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from servo.cli import main
from servo.mistake import Mistake, Refused
from servo.output.versions import SOURCE
from servo.study import store
from servo.study.parse import load
from servo.study.record_file import encoded, records_of, table_in
from servo.study.run import Failure
from servo.study.scenario_run import TIMES
from servo.study.store import StudyFile


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


def run_file(folder, number):
    return folder / "runs" / f"{number:06}.parquet"


def flipped(raw, at):
    return raw[:at] + bytes([raw[at] ^ 0x10]) + raw[at + 1 :]


def alien(path, column, values):
    """Replace a column of a file whose digest then fits what is in it."""
    table = table_in(path.read_bytes())
    place = table.column_names.index(column)
    path.write_bytes(encoded(table.set_column(place, column, pa.array(values))))


def flipped_name(raw):
    """With another letter in the run's outcome."""
    return flipped(raw, raw.index(b"TIMED_OUT") + 2)


DAMAGE = {
    "half a file": lambda f: run_file(f, 2).write_bytes(run_file(f, 2).read_bytes()[:4000]),
    "zeros": lambda f: run_file(f, 2).write_bytes(bytes(5000)),
    "an empty file": lambda f: run_file(f, 2).write_bytes(b""),
    "no file": lambda f: run_file(f, 2).unlink(),
    "a flipped bit": lambda f: run_file(f, 2).write_bytes(
        flipped_name(run_file(f, 2).read_bytes())
    ),
    "no rows": lambda f: pq.write_table(pq.read_table(run_file(f, 2))[:0], run_file(f, 2)),
    "another run's row": lambda f: shutil.copy(run_file(f, 1), run_file(f, 2)),
    "a record of something else": lambda f: alien(run_file(f, 2), "record", ["{}"]),
    "a record that is a list": lambda f: alien(run_file(f, 2), "record", ["[]"]),
    "a text for a number": lambda f: alien(run_file(f, 2), "run", ["a"]),
    "a text for a sheet": lambda f: alien(run_file(f, 2), "sheet", ["a"]),
    "fewer columns": lambda f: pq.write_table(
        pq.read_table(run_file(f, 2)).drop_columns(["record"]), run_file(f, 2)
    ),
}


@pytest.mark.parametrize("damage", DAMAGE)
def test_what_does_not_fit_the_plan_is_run_again(small, folder, damage):
    DAMAGE[damage](folder)
    with opened(small, folder) as kept:
        assert set(kept.done) == {"000000", "000001", "000003"}
        assert len(kept.damaged) == (damage != "no file")


def test_no_flipped_bit_changes_what_is_read(small, folder):
    raw = run_file(folder, 2).read_bytes()
    (before,), detected = records_of(table_in(raw)), 0
    places = np.random.default_rng(0).integers(len(raw), size=300)
    for at in places.tolist():
        found = list(records_of(table_in(flipped(raw, at))))
        detected += not found
        assert [record.row for record in found] in ([], [before.row])
    assert detected > 200


def test_a_whole_folder_is_complete(small, folder):
    with opened(small, folder) as kept:
        assert (len(kept.done), kept.damaged) == (4, [])


def call(monkeypatch, capfd, *arguments):
    monkeypatch.setattr(sys, "argv", ["servobench", *arguments])
    with pytest.raises(SystemExit) as ended:
        main.main()
    out, err = capfd.readouterr()
    return ended.value.code or 0, out, err


def untimed(path):
    (record,) = records_of(table_in(path.read_bytes()))
    return {name: value for name, value in record.row.items() if name not in TIMES}


@pytest.mark.usefixtures("no_workers")
def test_the_command_says_what_it_runs_again_and_ends_with_the_same_numbers(
    monkeypatch, capfd, folder
):
    before = untimed(run_file(folder, 2))
    run_file(folder, 2).write_bytes(flipped_name(run_file(folder, 2).read_bytes()))
    code, _, err = call(monkeypatch, capfd, "sweep", "mine.toml", "--out", "out")
    assert (code, err) == (
        0,
        "servobench: out/runs/000002.parquet: these are not the rows as they were written "
        "(the first of 1 such files); what is missing is run again\n",
    )
    assert untimed(run_file(folder, 2)) == before


@pytest.fixture
def few(monkeypatch):
    """Three records are many, and two fit into a joined file."""
    monkeypatch.setattr(store, "LOOSE", 3)
    monkeypatch.setattr(store, "JOINED", 2)


def files_in(folder):
    return sorted(path.stem for path in (folder / "runs").iterdir())


JOINED = ["000000-000001", "000002-000003"]


@pytest.mark.usefixtures("few")
@pytest.mark.parametrize("order", [1, -1])
def test_many_records_are_joined_in_whatever_order_they_come(small, folder, order, study_place):
    jobs = list(small.jobs())
    with opened(small, folder) as kept:
        whole = kept.table()
        records = kept.records(jobs)
    with opened(small, study_place / "other") as kept:
        counts = []
        for job, record in list(zip(jobs, records, strict=True))[::order]:
            kept.add(job, record)
            counts.append(len(files_in(kept.folder)))
        assert counts == [1, 2, 2, 3]
        kept.join()
        assert files_in(kept.folder) == JOINED
        assert kept.table().equals(whole)
        for before, after in zip(records, kept.records(jobs), strict=True):
            assert before.sheet == after.sheet
            np.testing.assert_equal(before.series, after.series)


@pytest.fixture
def joined(small, folder, few):
    """The folder with joined files, and beside it `loose`, as it was before."""
    shutil.copytree(folder, folder.parent / "loose")
    with opened(small, folder) as kept:
        kept.join()
    assert files_in(folder) == JOINED
    return folder


def test_records_that_a_killed_client_has_joined_but_not_removed_are_there_once(small, joined):
    for number in (1, 2):
        shutil.copy(run_file(joined.parent / "loose", number), joined / "runs")
    with opened(small, joined) as kept:
        assert (len(kept.done), kept.damaged) == (4, [])
        assert kept.table()["run"].to_pylist() == [0, 1, 2, 3]
        kept.join()
        assert files_in(joined) == JOINED


def test_a_damaged_joined_file_costs_its_own_runs_only(small, joined):
    path = joined / "runs" / "000002-000003.parquet"
    path.write_bytes(flipped_name(path.read_bytes()))
    with opened(small, joined) as kept:
        assert (set(kept.done), kept.damaged) == ({"000000", "000001"}, [path])
        for job in list(small.jobs())[2:]:
            kept.add(job, job.run(joined))
        kept.join()
    with opened(small, joined) as kept:
        assert (len(kept.done), kept.damaged) == (4, [])


def test_a_record_that_is_forgotten_and_done_again_replaces_the_joined_one(small, joined):
    with opened(small, joined) as kept:
        job = list(small.jobs())[1]
        (record,) = kept.records([job])
        kept.forget(job)
        kept.add(job, replace(record, outcome="again"))
        kept.join()
        assert kept.table()["outcome"].to_pylist()[1] == "again"
        assert files_in(joined) == JOINED


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
        "2; choose another folder with --out"
    )


def test_runs_without_their_description_are_refused(small, folder):
    (folder / "study.json").unlink()
    assert refused(small, folder) == (
        f"{folder}: there is something in this folder, but no study.json of `servobench sweep`; "
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
    other = (
        "this was begun with servobench None, but 0.1.0 is installed: the numbers could not be "
        "compared"
    )
    damaged = "this file is damaged, so the results beside it cannot be identified"
    assert (other if versions in ({}, {"mujoco": "4"}) else damaged) in refused(small, folder)


def test_another_study_other_versions_and_other_code_are_refused(small, folder):
    assert refused(small, folder, seeds=[0]) == (
        f"{folder}: this folder holds another study (its seeds differs); choose another folder "
        "with --out"
    )
    versions = StudyFile.of(small, "me").versions
    assert refused(small, folder, versions=versions | {"mujoco": "9.9"}) == (
        f"{folder}: this was begun with mujoco {versions['mujoco']}, but 9.9 is installed: "
        "the numbers could not be compared; choose another folder with --out"
    )
    assert refused(small, folder, versions=versions | {SOURCE: "0"}) == (
        f"{folder}: this was begun with servobench source {versions[SOURCE]}, but 0 is "
        "installed: the numbers could not be compared; choose another folder with --out"
    )


def test_a_row_of_a_worker_with_other_code_is_refused(small, folder):
    job = next(small.jobs())
    record = job.run(folder)
    with opened(small, folder) as kept, pytest.raises(Mistake) as said:
        kept.add(job, replace(record, versions=record.versions | {SOURCE: "abc"}))
    assert str(said.value) == (
        f"a worker has servobench source abc, but {record.versions[SOURCE]} is "
        "installed here: the numbers could not be compared; install the same on every worker"
    )


def test_a_folder_of_something_else_is_refused_and_left_alone(small, study_place):
    (study_place / "notes").mkdir()
    (study_place / "notes" / "thesis.txt").write_text("mine")
    assert "there is something in this folder, but no study.json" in refused(
        small, study_place / "notes"
    )
    assert sorted(p.name for p in (study_place / "notes").iterdir()) == ["thesis.txt"]


def test_a_sweep_that_was_killed_at_once_goes_on(small, study_place):
    for part in ("runs", "failures"):
        (study_place / "out" / part).mkdir(parents=True)
    (study_place / "out" / ".study.json.part").write_text("{")
    with opened(small, study_place / "out") as kept:
        assert kept.done == {}


def test_two_sweeps_do_not_write_into_one_folder(small, folder):
    with opened(small, folder):
        assert refused(small, folder) == f"{folder}: another command is writing into this folder"
    with opened(small, folder):
        pass


def test_a_full_disk_is_one_sentence_and_leaves_what_there_is(monkeypatch, small, folder):
    job = next(small.jobs())
    record = job.run(folder)

    def full(descriptor):
        raise OSError(28, "No space left on device")

    with opened(small, folder) as kept:
        monkeypatch.setattr(os, "fsync", full)
        with pytest.raises(Refused) as said:
            kept.add(job, record)
    assert str(said.value) == (
        f"{folder}: cannot write run 000000: No space left on device; what is there already is "
        "whole, and the same command goes on from it"
    )
    monkeypatch.undo()
    assert not list((folder / "runs").glob(".*"))
    with opened(small, folder) as kept:
        assert len(kept.done) == 4


def test_a_folder_that_cannot_be_made_is_one_sentence(small, study_place):
    (study_place / "file").write_text("")
    assert refused(small, study_place / "file" / "out") == (
        f"{study_place}/file/out: cannot write to this folder: Not a directory"
    )


def test_a_pipe_in_place_of_a_record_is_not_waited_for(small, folder):
    """Reading a pipe that nobody writes to would never end."""
    path = folder / store.RUNS / "000000.parquet"
    path.unlink()
    os.mkfifo(path)
    found = store.Store(folder)
    found.find(small.jobs())
    assert set(found.done) == {job.key for job in small.jobs()} - {"000000"}
    assert found.damaged == []
