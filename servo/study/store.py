"""The folder of a study, in which finished runs stay when a process is killed.

`study.json` describes the study. The record of each finished run is a Parquet file of one row,
written under another name, flushed to the disk and renamed. When there are `LOOSE` of them, they
are joined with those of neighbouring runs, up to `JOINED` in a file, and then removed. A record
that is damaged or not of its job counts as missing. One process writes at a time.
"""

from __future__ import annotations

from collections.abc import Generator, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import pyarrow as pa
from filelock import FileLock, Timeout

from servo.mistake import Mistake, Refused, unwritable
from servo.output.formats import Document, Made, Number, OtherFormat
from servo.output.versions import versions
from servo.study.plan import Study
from servo.study.record_file import (
    JOB,
    KEY,
    RUN,
    encoded,
    file_table,
    merged,
    records_of,
    table_in,
    table_of,
)
from servo.study.run import Failure, Job, Record, key_of
from tracking.files import atomic
from tracking.files.json_text import as_json

RUNS = "runs"
FAILURES = "failures"
RESULTS = "results.parquet"
LOCK = ".lock"
LOOSE = 50
"""Most files of one record: a study of at least so many runs ends with joined files only."""
JOINED = 1000
"""Most records of a joined file; with MOST_RUNS there are a hundred files."""
MOST_FAILURES = 40
"""Most failures with a file of their own."""
DECIDE = ("table", "axes", "draws", "seeds", "scenarios", "files")
"""Keys of study.json that must not differ between the sessions of one study."""
GOES_ON = "the same command goes on from there"


@dataclass(frozen=True, slots=True, kw_only=True)
class StudyFile(Made):
    """study.json: all that defines a study."""

    FILE: ClassVar[str] = "study.json"
    KIND: ClassVar[str] = "study"
    FORMAT: ClassVar[int] = 2

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
    """failures/NUMBER.json: a run that ended in an error; it stays when the run is tried again and
    finishes, because something in it does not repeat itself then.
    """

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


@contextmanager
def opened(folder: Path, described: StudyFile) -> Generator[Store]:
    """The store in a folder, which is made if it is not there; locked until the block ends.

    Nothing is written into a folder that belongs to something else.

    Args:
        folder: The study's folder.
        described: The study, as this session begins it.

    Raises:
        Mistake: The folder cannot be written or holds something else, results of other versions
            are in it, or another process is writing into it.
    """
    try:
        if folder.is_dir():
            _described(folder, described.holds)
        folder.mkdir(parents=True, exist_ok=True)
        lock = FileLock(folder / LOCK)
        lock.acquire(blocking=False)
    except Timeout:
        raise Mistake(f"{folder}: another command is writing into this folder") from None
    except OSError as error:
        raise unwritable(folder, error) from None
    try:
        before = _described(folder, described.holds)
        if before is not None:
            _check_same(folder, before, described)
        store = Store(folder)
        with store.on_disk(described.FILE):
            if before is None:
                described.write(folder)
        for part in (RUNS, FAILURES):
            with store.on_disk(part):
                atomic.folder(folder, part)
        yield store
    finally:
        lock.release()


def _described(folder: Path, holds: str) -> StudyFile | None:
    """The description that a folder's first session wrote."""
    path = folder / StudyFile.FILE
    if not path.exists():
        if any(not _of_the_beginning(there) for there in folder.iterdir()):
            raise Mistake(
                f"{folder}: there is something in this folder, but no {path.name} of `servobench "
                f"{holds}`; choose another folder with --out"
            )
        return None
    try:
        return StudyFile.read(path)
    except OtherFormat as error:
        raise Mistake(f"{error.fact}; choose another folder with --out") from None
    except Mistake:
        raise Mistake(
            f"{path}: this file is damaged, so the results beside it cannot be identified; "
            "choose another folder with --out"
        ) from None


def _of_the_beginning(path: Path) -> bool:
    """Whether a first session that was killed early may have left this."""
    empty = path.name in (RUNS, FAILURES) and path.is_dir() and not any(path.iterdir())
    return empty or path.name in (LOCK, atomic.ASIDE.format(StudyFile.FILE))


def _check_same(folder: Path, before: StudyFile, now: StudyFile) -> None:
    if before.holds != now.holds:
        raise Mistake(
            f"{folder}: this folder holds results of another command; choose another folder with "
            "--out"
        )
    for what in DECIDE:
        if as_json(getattr(before, what)) != as_json(getattr(now, what)):
            raise Mistake(
                f"{folder}: this folder holds another study (its {what} differs); choose another "
                "folder with --out"
            )
    for name, version in now.versions.items():
        if before.versions.get(name) != version:
            raise Mistake(
                f"{folder}: this was begun with {name} {before.versions.get(name)}, but {version} "
                "is installed: the numbers could not be compared; choose another folder with --out"
            )


class Store:
    """A study's folder, for one writer."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.done: dict[str, Path] = {}
        """The files of the jobs that have a record, by key."""
        self.damaged: list[Path] = []
        """Files with records that cannot be read or are of another job; they are done again."""
        self._loose: dict[str, int] = {}
        """Places in the study of the jobs whose record has a file of its own, by key."""

    def find(self, jobs: Iterable[Job] | None = None) -> None:
        """Look for the records of jobs, or for all; they are in `done` then."""
        # Reading anything else could wait for ever, as a pipe does.
        there = sorted(path for path in (self.folder / RUNS).rglob("*.parquet") if path.is_file())
        wanted = None if jobs is None or not there else {job.key: job.digest for job in jobs}
        for path in there:  # a joined file comes before those of its own runs, which are newer
            table = table_in(_content(path))
            rows = zip(*(table[name].to_pylist() for name in (KEY, JOB, RUN)), strict=True)
            ours = [row for row in rows if wanted is None or row[0] in wanted]
            fit = {
                key: number
                for key, job, number in ours
                if path in (self._path(key), self._joined(number))
                and (wanted is None or job == wanted[key])
            }
            if not table.num_rows or len(fit) < len(ours):
                self.damaged.append(path)
            self.done |= dict.fromkeys(fit, path)
            self._loose |= {key: n for key, n in fit.items() if path == self._path(key)}

    def read(self, keys: Iterable[str], *, long: bool = False) -> Iterator[dict[str, Record]]:
        """The records of jobs that have one by key, file by file.

        Args:
            keys: Of the jobs.
            long: Whether the records keep their series and contact sheets.

        Raises:
            Refused: A file has changed since it was found.
        """
        for some, table in self._files(keys):
            yield dict(zip(some, records_of(table, long=long), strict=True))

    def records(self, jobs: Iterable[Job]) -> list[Record]:
        """The records of the jobs that have one, with their series, in the order of the jobs.

        Raises:
            Refused: A file has changed since it was found.
        """
        keys = [job.key for job in jobs if job.key in self.done]
        found: dict[str, Record] = {}
        for batch in self.read(keys, long=True):
            found |= batch
        return [found[key] for key in keys]

    def table(self) -> pa.Table:
        """The rows of all records, at least one, in the order of the study.

        Raises:
            Refused: A file has changed since it was found.
        """
        return table_of(table for _, table in self._files(self.done))

    def _files(self, keys: Iterable[str]) -> Iterator[tuple[list[str], pa.Table]]:
        """The keys and the rows of jobs that have a record, file by file."""
        wanted: dict[Path, list[str]] = {}
        for key in keys:
            wanted.setdefault(self.done[key], []).append(key)
        for path, some in wanted.items():
            table = table_in(_content(path))
            places = {key: place for place, key in enumerate(table[KEY].to_pylist())}
            if not places.keys() >= {*some}:
                raise Refused(
                    f"{path}: this file was changed; the same command repeats what is missing"
                )
            yield some, table.take([places[key] for key in some])

    def add(self, job: Job, record: Record) -> None:
        """Keep the record of a job.

        Raises:
            Mistake: The worker has other versions.
            Refused: The disk is full, or the file cannot be written.
        """
        for name, here in versions().items():
            there = record.versions.get(name)
            if there != here:
                raise Mistake(
                    f"a worker has {name} {there}, but {here} is installed here: the numbers could "
                    "not be compared; install the same on every worker"
                )
        path = self._path(job.key)
        raw = encoded(file_table(job, record))
        try:
            with self.on_disk(f"run {job.key}"):
                atomic.write(self.folder, f"{RUNS}/{job.key}.parquet", raw)
            self.done[job.key] = path
        except KeyboardInterrupt:
            if _content(path) == raw:  # interrupted after the renaming
                self.done[job.key] = path
            raise
        self._loose[job.key] = job.number
        if len(self._loose) >= LOOSE:
            self.join()

    def join(self) -> None:
        """Join records that have files of their own, if the study has many.

        Raises:
            Refused: As for `add`.
        """
        if len(self.done) < LOOSE:
            return
        by_file: dict[Path, list[str]] = {}
        for key, number in self._loose.items():
            by_file.setdefault(self._joined(number), []).append(key)
        for joined, keys in by_file.items():
            own = [self._path(key) for key in keys]
            raw = encoded(merged(table_in(_content(path)) for path in (joined, *own)))
            with self.on_disk(f"{RUNS}/{joined.name}"):
                atomic.write(self.folder, f"{RUNS}/{joined.name}", raw)
                self.done |= dict.fromkeys(keys, joined)
                for path in own:
                    path.unlink(missing_ok=True)
        self._loose.clear()

    def forget(self, job: Job) -> None:
        """Let a job be done again; its new record replaces the old one."""
        del self.done[job.key]

    def fail(self, job: Job, failure: Failure) -> None:
        """Keep why a job failed, unless many have; the next session does it again.

        Raises:
            Refused: As for `add`.
        """
        if failure.full:
            raise Refused(f"{failure.reason}; what is in {self.folder} is whole; {GOES_ON}")
        with self.on_disk(f"run {job.key}"):
            path = self.failure_path(job)
            if path.exists() or sum(1 for _ in path.parent.glob("*")) < MOST_FAILURES:
                FailureFile.of(job, failure.error).write(path.parent, path.name)

    def write(self, name: str, content: bytes | str) -> Path:
        """Write another file of the study; its path.

        Raises:
            Refused: As for `add`.
        """
        with self.on_disk(name):
            return atomic.write(self.folder, name, content)

    @contextmanager
    def on_disk(self, what: str) -> Generator[None]:
        """Turn an error of the disk in the block into a sentence; `what` is written there."""
        try:
            yield
        except OSError as error:
            raise Refused(
                f"{self.folder}: cannot write {what}: {error.strerror}; what is there already is "
                "whole, and the same command goes on from it"
            ) from None

    def failure_path(self, job: Job) -> Path:
        """The file that says why a job failed."""
        return self.folder / FAILURES / f"{job.key}.json"

    def _path(self, key: str) -> Path:
        return self.folder / RUNS / f"{key}.parquet"

    def _joined(self, number: int) -> Path:
        """The file that a run is joined into, by its place in the study."""
        first = number - number % JOINED
        return self.folder / RUNS / f"{key_of(first)}-{key_of(first + JOINED - 1)}.parquet"


def _content(path: Path) -> bytes:
    """What a file contains; nothing, if it cannot be read."""
    try:
        # Read into memory first: the file could change while it is parsed.
        return path.read_bytes()
    except OSError:
        return b""
