"""A run of a study as values: a `Job` before the run, and a `Record` or a `Failure` after it."""

import hashlib
import json
import traceback
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from servo.mistake import FULL, Mistake
from servo.output.versions import versions
from servo.scenario.toml import Table
from servo.study.bounds import MissedBound
from tracking.files.json_text import as_json, number

Task = TypeVar("Task")
Done = TypeVar("Done")
Item = TypeVar("Item")
Key = TypeVar("Key")
Series = NDArray[Any]
"""Numbers or flags (n,)."""
RunRow = Mapping[str, Any]
"""A run's row in a table of results: values by column."""
SCENARIO = "scenario"
SEQUENCE = "sequence"


class Subject(Protocol):
    """Protocol of what a job runs: a scenario, or a tracker on a recorded or synthetic sequence of
    pictures.
    """

    @property
    def name(self) -> str:
        """Return the name of the scenario or of the sequence, as it stands in tables of results."""
        ...

    def describe(self) -> dict[str, object]:
        """Return the settings that decide the results of a run, as a dictionary that JSON can hold;
        without the seed and the settings of the job. `Job.digest` calls it.
        """
        ...

    def perform(self, job: "Job", folder: Path) -> "Record":
        """Run a job and return its record (the results); `Job.run` calls it, in a worker process if
        there are several workers.

        Args:
            job: The job, whose `subject` is this object; it has the seed, and the values of the
                settings that the study varies or draws at random.
            folder: The study's folder, into which further files, such as a tracker's estimates, may
                be written.
        """
        ...


@dataclass(frozen=True, slots=True)
class Job:
    """One run of a study, as it is planned: what is run (`subject`), its seed, and its values of
    the settings that the study varies or draws at random, by name (`settings`). `number` is its
    place in the study, from 0; if `pictured`, the record gets an image with pictures of the run.
    Jobs are sent to worker processes.
    """

    number: int
    """Place in its study, from 0."""
    subject: Subject
    """The scenario, or the tracker and its sequence."""
    seed: int
    settings: Table = field(default_factory=dict[str, object])
    """Values of the study's axes and drawn settings in this run, by name."""
    command: str = ""
    """Command line that repeats this run alone."""
    pictured: bool = False
    """Whether a contact sheet of the run is made."""
    name: str = ""
    """Unique name in the study's folder, for jobs without a number in a plan."""

    @property
    def key(self) -> str:
        """Return the name under which the study's folder stores the record of this run: `name`, or
        without one the number with six digits, such as "000012".
        """
        return self.name or key_of(self.number)

    @property
    def digest(self) -> str:
        """Return the SHA-256 digest, 64 hexadecimal digits, of the subject's description, the seed
        and the settings of this job. Equal jobs have equal digests; versions of packages do not
        count.
        """
        described = {
            "subject": self.subject.describe(),
            "seed": self.seed,
            "settings": self.settings,
        }
        return hashlib.sha256(json.dumps(as_json(described)).encode()).hexdigest()

    def run(self, folder: Path) -> "Record":
        """Run this job and return the record of its results; further files, such as a tracker's
        estimates, go into `folder`, the study's folder.

        Raises:
            Mistake: A setting of a scenario is not valid, one of its components failed, a package
                that it needs is missing, or a file that the study names is missing or has changed.
            ValueError: A sequence of pictures cannot be read, or the tracker refuses the target's
                region in the first picture.
            OSError: A file cannot be written.
        """
        return self.subject.perform(self, folder)


@dataclass(frozen=True, slots=True, kw_only=True)
class Record:
    """The results of one finished run of a scenario, or of a tracker on a sequence of pictures
    (`subject_is`: "scenario" or "sequence"): its outcome, measures by name, bounds that it did not
    keep, and values over time by name (`series`). `sheet` is an image with pictures of the run, as
    JPEG.
    """

    number: int = 0
    """Place in its study, from 0."""
    subject: str
    """Name of the scenario or the sequence."""
    subject_is: str = SCENARIO
    """SCENARIO or SEQUENCE."""
    seed: int
    settings: dict[str, Any] = field(default_factory=dict[str, Any])
    """Values of the study's axes and drawn settings in this run, by name. For a run on a sequence
    also "family" (name of the recording, or of the kind of painted sequence), "drawn" (whether it
    is painted), "frames" (number of pictures that were tracked) and "remarks" (sentences about
    pictures that cannot be read, or change their size)."""
    command: str = ""
    """Command line that repeats this run alone."""
    outcome: str
    """Name of the run's `Outcome`; for a run on a sequence COMPLETED or LOST."""
    limits: tuple[str, ...] = ()
    """The limits of joints, such as "elbow (range)", that were hit. With the outcome LIMIT_HIT: all
    in the last second. With CONVERGED: none. With another outcome: only ends of ranges, in the last
    second in which the target was not lost."""
    off: tuple[str, ...] = ()
    """Errors that were too large at the end, such as "angle 27 deg"; none unless the outcome is
    TIMED_OUT."""
    success: bool
    """Whether the run ended as expected."""
    measures: dict[str, float]
    """Measures by name; nan or infinite without a value."""
    missed: tuple[MissedBound, ...] = ()
    """Bounds that the run did not keep."""
    repeats: bool = True
    """Whether a repetition should give the same numbers, judged from the settings only
    (`servo.testing` finds components that do not repeat)."""
    versions: dict[str, str] = field(default_factory=versions)
    """Versions of the packages that decide the numbers, by name."""
    series: dict[str, Series] = field(default_factory=dict[str, Series])
    """Values over time, or curves, by name."""
    sheet: bytes | None = None
    """A contact sheet of the run's pictures as JPEG."""
    seconds: float = np.nan
    """Wall-clock time of the run [s]; nan in a record that was read from a file."""

    @property
    def row(self) -> RunRow:
        """Return the values of the run by column of a table of results; a measure that is nan or
        infinite is None.
        """
        return {
            "run": self.number,
            self.subject_is: self.subject,
            "seed": self.seed,
            **self.settings,
            "repeats": self.repeats,
            "outcome": self.outcome,
            "success": self.success,
            "missed": [
                {
                    "name": m.name,
                    "found": None if m.found is None else str(m.found),
                    "bound": str(m.bound),
                }
                for m in self.missed
            ],
            **{name: number(value) for name, value in self.measures.items()},
            **version_columns(self.versions),
        }


def grouped_by(items: Iterable[Item], key: Callable[[Item], Key]) -> dict[Key, list[Item]]:
    """Return lists of items, such as records, by the key that the function `key` returns for them;
    keys and items stay in the order of `items`.
    """
    found: dict[Key, list[Item]] = {}
    for item in items:
        found.setdefault(key(item), []).append(item)
    return found


def key_of(number: int) -> str:
    """Return the name under which a study stores the run of a number: "000012" for 12."""
    return f"{number:06}"


def version_columns(found: Mapping[str, str]) -> dict[str, str]:
    """Return versions by name of their column in a table of results: {"version_numpy": "2.1"} for
    {"numpy": "2.1"}. Hyphens and spaces in names become "_".
    """
    return {f"version_{n.replace('-', '_').replace(' ', '_')}": v for n, v in found.items()}


class ClusterLost(RuntimeError):
    """Error: a Dask cluster has stopped working, or one of its workers has several threads; the
    message says which.
    """


@dataclass(frozen=True, slots=True)
class Failure:
    """The error that ended a job without a record: its traceback (`error`); a sentence (`mistake`)
    if it is a mistake of the user, or if the machine has no room left, else ""; and whether the
    machine has no room left (disk, memory, processes or open files), so that all other jobs would
    fail too (`full`).
    """

    error: str
    """The traceback; if the job's workers died, a sentence that says so."""
    mistake: str = ""
    """A sentence, if the error is a mistake of the user, or if the machine has no room left; else
    ""."""
    full: bool = False
    """Whether the machine has no room left (disk, memory, processes or open files), so that all
    other jobs would fail too."""

    @staticmethod
    def of(error: BaseException) -> "Failure":
        """Return the failure of a job that raised an exception, with the exception's traceback, and
        with a sentence if it is a mistake of the user, or if the machine has no room left (disk,
        memory, processes or open files).
        """
        trace = "".join(traceback.format_exception(error))
        if isinstance(error, OSError) and error.errno in FULL:
            place = f"{error.filename}: " if error.filename else ""
            return Failure(trace, f"{place}{error.strerror}", full=True)
        # A thread that cannot be started has no memory for its stack.
        if isinstance(error, MemoryError) or "can't start new thread" in str(error):
            return Failure(
                trace,
                "there is too little memory, or too few processes are allowed (ulimit -a) "
                f"({str(error) or 'MemoryError'})",
                full=True,
            )
        return Failure(trace, str(error) if isinstance(error, Mistake) else "")

    @property
    def reason(self) -> str:
        """Return the sentence for the user (`mistake`), or, if there is none, the last line of
        `error`.
        """
        return self.mistake or self.error.strip().splitlines()[-1]


def attempt(work: Callable[[Task], Done], task: Task) -> Done | Failure:
    """Do a task by calling `work`; return its result, or a `Failure` if `work` raises an
    exception.
    """
    try:
        return work(task)
    except Exception as error:
        return Failure.of(error)
