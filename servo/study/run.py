"""A run of a study: its job beforehand; afterwards its record, or the reason why it has none."""

from __future__ import annotations

import hashlib
import json
import traceback
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from servo.mistake import FULL, Mistake
from servo.output.versions import versions
from servo.scenario.draws import Value
from servo.study.bounds import MissedBound
from tracking.files.json_text import as_json, number

Row = Mapping[str, Any]
"""The cells of a record by column."""
SCENARIO = "scenario"
SEQUENCE = "sequence"
VERSION = "version_"
NO_THREAD = "can't start new thread"
"""Python's words where there is no memory for the stack of a thread."""
TOO_LITTLE = "there is too little memory, or too few processes are allowed (ulimit -a)"


class Subject(Protocol):
    """What a job runs."""

    @property
    def name(self) -> str:
        """Its name in tables."""
        ...

    def describe(self) -> dict[str, Any]:
        """Return what decides the numbers, in the types of JSON."""
        ...

    def perform(self, job: Job, folder: Path) -> Record:
        """Run a job of this subject; it may write files of its own into the study's folder."""
        ...


@dataclass(frozen=True, slots=True)
class Job:
    """One run, with all that a worker needs; it is sent between processes."""

    number: int
    """Place in its study, from 0."""
    subject: Subject
    seed: int
    settings: dict[str, Value] = field(default_factory=dict[str, Value])
    """What distinguishes it from the others: values of axes and draws, by key."""
    command: str = ""
    """Repeats this run alone."""
    pictured: bool = False
    """Whether its contact sheet is kept."""
    name: str = ""
    """Name of its file, where other jobs than those of one plan share the folder."""

    @property
    def key(self) -> str:
        """Name of its file."""
        return self.name or key_of(self.number)

    def describe(self) -> dict[str, Any]:
        """Return what decides its record, versions apart, in the types of JSON."""
        return {"subject": self.subject.describe(), "seed": self.seed, "settings": self.settings}

    @property
    def digest(self) -> str:
        """Digest of what decides its record, versions apart."""
        return hashlib.sha256(json.dumps(as_json(self.describe())).encode()).hexdigest()

    def run(self, folder: Path) -> Record:
        """Run it; `folder` is that of its study.

        Raises:
            Mistake: A setting is not valid.
        """
        return self.subject.perform(self, folder)


@dataclass(frozen=True, slots=True, kw_only=True)
class Record:
    """A finished run of a scenario in the closed loop, or of a tracker on a sequence."""

    number: int = 0
    """Place in its study, from 0."""
    subject: str
    """Name of the scenario or the sequence."""
    subject_is: str = SCENARIO
    seed: int
    settings: dict[str, Any] = field(default_factory=dict[str, Any])
    """What distinguishes the run from others of its study: values of axes and draws by key."""
    command: str = ""
    """Repeats the run alone."""
    outcome: str
    """Name of the outcome."""
    limits: tuple[str, ...] = ()
    """The joints whose limits were hit, where this is the outcome; not in a row."""
    off: tuple[str, ...] = ()
    """What was too far from the goal in the end, where time ran out; not in a row."""
    success: bool
    """Whether it ended as expected."""
    measures: dict[str, float]
    """Values by name; nan or infinite where there is no value."""
    missed: tuple[MissedBound, ...] = ()
    repeats: bool = True
    """Whether a repetition gives the same numbers, by the scenario's settings: a user's part that
    draws random numbers of its own is not noticed, but `servo.testing` finds it."""
    versions: dict[str, str] = field(default_factory=versions)
    """Those that decide the numbers."""
    series: dict[str, NDArray[Any]] = field(default_factory=dict[str, NDArray[Any]])
    """Values over time, or curves, by name."""
    sheet: bytes | None = None
    """A contact sheet as JPEG."""
    seconds: float = np.nan
    """Wall-clock time; nan in a record that was read from a file."""

    @property
    def row(self) -> Row:
        """The short columns of its row; a measure without a finite value is None."""
        return {
            "run": self.number,
            self.subject_is: self.subject,
            "seed": self.seed,
            **self.settings,
            "repeats": self.repeats,
            "outcome": self.outcome,
            "success": self.success,
            "missed": [
                {"name": m.name, "found": _text(m.found), "bound": _text(m.bound)}
                for m in self.missed
            ],
            **{name: number(value) for name, value in self.measures.items()},
            **version_columns(self.versions),
        }


def key_of(number: int) -> str:
    """Name of the file of a run by its place in its study."""
    return f"{number:06}"


def version_columns(found: Mapping[str, str]) -> dict[str, str]:
    """Versions by the name of their column."""
    return {f"{VERSION}{n.replace('-', '_').replace(' ', '_')}": v for n, v in found.items()}


def _text(value: float | str | None) -> str | None:
    return None if value is None else str(value)


class ClusterLost(RuntimeError):
    """A cluster that has stopped working; the message names it and the reason."""


@dataclass(frozen=True, slots=True)
class Failure:
    """Why a job has no record."""

    error: str
    """The traceback."""
    mistake: str = ""
    """The sentence, where it is the user's mistake or the machine's lack of room."""
    full: bool = False
    """Whether the machine has no more room: the other jobs would fail as well."""

    @staticmethod
    def of(error: BaseException) -> Failure:
        """Describe an error that a job raised."""
        trace = "".join(traceback.format_exception(error))
        if isinstance(error, OSError) and error.errno in FULL:
            return Failure(trace, f"{error.filename}: {error.strerror}", full=True)
        if isinstance(error, MemoryError) or NO_THREAD in str(error):
            return Failure(trace, f"{TOO_LITTLE} ({error or 'MemoryError'})", full=True)
        return Failure(trace, str(error) if isinstance(error, Mistake) else "")

    @property
    def reason(self) -> str:
        """The sentence, or the last line of the traceback."""
        return self.mistake or self.error.strip().splitlines()[-1]
