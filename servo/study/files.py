"""The JSON files of a study's folder: what defines the study, and why a run failed."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar

from servo.output.formats import Document, Made, Number
from servo.output.versions import versions
from servo.study.job import Job
from servo.study.plan import Study


@dataclass(frozen=True, slots=True, kw_only=True)
class StudyFile(Made):
    """study.json: all that defines a study."""

    FILE: ClassVar[str] = "study.json"
    KIND: ClassVar[str] = "study"

    holds: str = "sweep"
    """The command whose results are in the folder."""
    name: str
    title: str
    axes: dict[str, list[Any]]
    draws: dict[str, dict[str, list[Any]]]
    """The law of each drawn setting, and its numbers."""
    seeds: list[int]
    compare: str | None
    """The axis whose values are compared with each other."""
    expect: dict[str, Number]
    runs: int
    table: dict[str, Any]
    """The study's TOML table, including the changes of the command line."""
    scenarios: dict[str, dict[str, Any]]
    """Tables of the scenarios that the study changes, by name."""
    files: dict[str, str] = field(default_factory=dict[str, str])
    """Digests of the files that these tables name, by path."""

    @staticmethod
    def of(study: Study, command: str) -> StudyFile:
        """The file of a study that a command line starts."""
        return StudyFile(
            command=command,
            versions=versions(),
            name=study.name,
            title=study.title,
            axes={a.key: list(a.values) for a in study.every_axis},
            draws={d.key: {d.law: list(d.numbers)} for d in study.draws},
            seeds=list(study.seeds),
            compare=study.compare,
            expect=study.expect,
            runs=study.size,
            table=study.table,
            scenarios={b.name: b.table for b in study.bases},
            files=study.files,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class FailureFile(Document):
    """failures/NUMBER.json: a run that ended in an error."""

    KIND: ClassVar[str] = "failure"

    run: int
    settings: dict[str, Any]
    command: str
    """The command that repeats this run alone."""
    error: str
    """The traceback."""

    @staticmethod
    def of(job: Job, error: str) -> FailureFile:
        """The file of a failed run."""
        settings = job.settings | {"seed": job.seed}
        return FailureFile(run=job.number, settings=settings, command=job.command, error=error)
