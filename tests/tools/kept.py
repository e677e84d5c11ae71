"""Runs in a study's folder that are made up, missing or damaged, for tests."""

import sqlite3
from contextlib import closing
from dataclasses import replace

from servo.output.versions import versions
from servo.study import store
from servo.study.run import Job
from servo.study.store import RUNS, StudyFile


class Made:
    """A subject."""

    def describe(self):
        return {}


def keep(folder, records):
    """Put records into a folder that has a study.json, whatever versions that names."""
    file = folder / StudyFile.FILE
    before = file.read_bytes()
    study = replace(StudyFile.read(file), versions=versions())
    study.write(folder)
    with store.opened(folder, study) as kept:
        for record in records:
            kept.add(Job(record.number, Made(), record.seed), record)
    file.write_bytes(before)


def execute(folder, statement, *values):
    """What a statement in SQL gives."""
    with closing(sqlite3.connect(folder / RUNS)) as database, database:
        return database.execute(statement, values).fetchall()


def drop(folder, *numbers):
    """Take runs out."""
    for number in numbers:
        execute(folder, "DELETE FROM runs WHERE key = ?", f"{number:06}")


def spoil(folder, number, column="record", value="changed"):
    """Change a run without its checksum."""
    execute(folder, f"UPDATE runs SET {column} = ? WHERE key = ?", value, f"{number:06}")


def found(folder):
    """The keys of the runs that are there."""
    return {key for (key,) in execute(folder, "SELECT key FROM runs")}
