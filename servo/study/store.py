"""The folder of a study, in which finished runs stay when a process is killed.

`study.json` describes the study. `runs.sqlite` has a row for each finished run, which is written to
the disk before the next one begins. At the end the rows are exported as `results.parquet` and
`series.parquet`, for other programs. One process writes at a time; others may read meanwhile.
"""

from __future__ import annotations

import errno
import sqlite3
import zlib
from collections.abc import Generator, Iterable, Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import pyarrow as pa
import pyarrow.parquet as pq
from filelock import FileLock, Timeout

from servo.mistake import Mistake, Refused, unwritable
from servo.output.formats import Document, Made, Number, OtherFormat
from servo.output.versions import versions
from servo.study.plan import Study
from servo.study.record_file import parquet, record_of, series_table, stored, table_of
from servo.study.run import Failure, Job, Record
from tracking.files import atomic
from tracking.files.json_text import as_json

RUNS = "runs.sqlite"
BESIDE = ("", "-wal", "-shm", "-journal")
"""Endings of the files that SQLite writes."""
SCHEMA = """
CREATE TABLE IF NOT EXISTS runs (
    key TEXT PRIMARY KEY,
    job TEXT,
    record TEXT,
    series BLOB,
    sheet BLOB,
    checksum INTEGER
)
"""
"""Rows have the key and the digest of the job, the record as `record_file.stored` returns it, and
a checksum of all this, because SQLite has none.
"""
FAILURES = "failures"
RESULTS = "results.parquet"
SERIES = "series.parquet"
LOCK = ".lock"
BATCH = 1000
"""Records that are in memory at the same time when tables are made."""
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
        """Return the file of a study that a command line starts."""
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
        """Return the file of a failed run."""
        settings = job.settings | {"seed": job.seed}
        return FailureFile(run=job.number, settings=settings, command=job.command, error=error)


@contextmanager
def opened(folder: Path, described: StudyFile) -> Generator[Store]:
    """Yield the store in a folder, which is made if it is missing, and is locked in the block.

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
        if before is None:
            with on_disk(folder, f"write {described.FILE}"):
                described.write(folder)
        with on_disk(folder, f"write {RUNS}"):
            database = _writable(folder / RUNS)
        with closing(database):
            yield Store(folder, database)
            # A reader at work may prevent this; the next session does it then.
            with suppress(sqlite3.Error):
                database.execute("PRAGMA journal_mode = DELETE")  # all is in one file now
    finally:
        lock.release()


def _writable(path: Path) -> sqlite3.Connection:
    """Open the database of a study, which is made if it is not there.

    Raises:
        OSError: There is a link or something else that is no file.
        sqlite3.Error: It cannot be written.
    """
    for ending in BESIDE:
        file = path.with_name(path.name + ending)
        if file.is_symlink() or (file.exists() and not file.is_file()):
            raise OSError(errno.ELOOP, "nothing is written through a link", file)
    database = sqlite3.connect(path, isolation_level=None)
    database.text_factory = _text
    try:
        with suppress(sqlite3.OperationalError):  # file systems of networks cannot do this
            database.execute("PRAGMA journal_mode = WAL")
        database.execute("PRAGMA synchronous = FULL")
        database.execute(SCHEMA)
    except BaseException:
        database.close()
        raise
    return database


def _readable(path: Path) -> sqlite3.Connection:
    """Open the database of a study to read it; another process may be writing into it."""
    place = f"{path.absolute().as_uri()}?mode=ro"
    database = sqlite3.connect(place, uri=True)
    try:
        database.execute("SELECT 1 FROM runs")
    except sqlite3.OperationalError:  # in a folder that is read-only, as that of an archive
        database.close()
        database = sqlite3.connect(f"{place}&immutable=1", uri=True)
    database.text_factory = _text
    return database


def _text(raw: bytes) -> str:
    """Return a text of the database; bytes that are damaged do not fit its checksum any more."""
    return raw.decode(errors="replace")


@contextmanager
def on_disk(folder: Path, action: str) -> Generator[None]:
    """Turn an error of the disk or of the database in the block into a sentence.

    Args:
        folder: The folder of the study.
        action: What the block does there, such as "write run 000000".

    Raises:
        Mistake: The database is damaged.
        Refused: The disk is full, or refuses for another reason.
    """
    try:
        yield
    except (OSError, sqlite3.OperationalError) as error:
        reason = (isinstance(error, OSError) and error.strerror) or error
        raise Refused(
            f"{folder}: cannot {action}: {reason}; what is there already is whole, and the same "
            "command goes on from it"
        ) from None
    except sqlite3.DatabaseError as error:
        raise Mistake(
            f"{folder / RUNS}: this file is damaged ({error}); choose another folder with --out"
        ) from None


def _described(folder: Path, holds: str) -> StudyFile | None:
    """Return the description that the first session wrote into a folder; None in a new folder."""
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
    """Return whether a first session that was killed early may have left this."""
    return path.name in (LOCK, atomic.ASIDE.format(StudyFile.FILE))


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
    """A study's folder, for one writer or for readers."""

    def __init__(self, folder: Path, database: sqlite3.Connection | None = None) -> None:
        """Name the folder; without a `database` to write to, the store can only be read."""
        self.folder = folder
        self.done: set[str] = set()
        """Keys of the jobs that have a record."""
        self.damaged: list[str] = []
        """Keys of rows that are not as they were written, or of another job; they are done again.
        """
        self._database = database

    def find(self, jobs: Iterable[Job] | None = None) -> None:
        """Look for the records of jobs, or for all; their keys are in `done` then.

        Raises:
            Mistake: The database is damaged.
            Refused: It cannot be read.
        """
        self.done = set()
        self.damaged = []
        if not (self.folder / RUNS).is_file():  # opening a pipe could wait for ever
            return
        wanted = None if jobs is None else {job.key: job.digest for job in jobs}
        with self._opened() as database:
            for *row, checksum in database.execute(
                "SELECT key, job, record, series, sheet, checksum FROM runs"
            ):
                key = row[0]
                if wanted is not None and key not in wanted:
                    continue
                if checksum == _checksum(row) and (wanted is None or row[1] == wanted[key]):
                    self.done.add(key)
                else:
                    self.damaged.append(key)

    def read(self, keys: Iterable[str], *, long: bool = False) -> Iterator[Record]:
        """Yield the records of jobs that have one.

        Args:
            keys: Of the jobs.
            long: Whether the records have their series and contact sheets.

        Raises:
            Refused: The database cannot be read.
        """
        if not self.done:  # perhaps there is no database yet
            return
        columns = "record, series, sheet" if long else "record, NULL, NULL"
        with self._opened() as database:
            for key in keys:
                found = database.execute(f"SELECT {columns} FROM runs WHERE key = ?", [key])
                yield record_of(*found.fetchone())

    def records(self, jobs: Iterable[Job]) -> list[Record]:
        """Return the records of the jobs that have one, with their series, in their order.

        Raises:
            Refused: The database cannot be read.
        """
        return list(self.read([job.key for job in jobs if job.key in self.done], long=True))

    def table(self) -> pa.Table:
        """Return the rows of all records, at least one, in the order of the study.

        Raises:
            Refused: The database cannot be read.
        """
        return table_of(self._batches(long=False))

    def _batches(self, *, long: bool) -> Iterator[list[Record]]:
        keys = sorted(self.done)
        for first in range(0, len(keys), BATCH):
            yield list(self.read(keys[first : first + BATCH], long=long))

    def add(self, job: Job, record: Record) -> None:
        """Keep the record of a job.

        Raises:
            Mistake: The worker has other versions.
            Refused: The disk is full, or the database cannot be written.
        """
        for name, here in versions().items():
            there = record.versions.get(name)
            if there != here:
                raise Mistake(
                    f"a worker has {name} {there}, but {here} is installed here: the numbers could "
                    "not be compared; install the same on every worker"
                )
        row = [job.key, job.digest, *stored(record)]
        with self._opened(f"write run {job.key}") as database:
            try:
                database.execute(
                    "INSERT OR REPLACE INTO runs VALUES (?, ?, ?, ?, ?, ?)", [*row, _checksum(row)]
                )
            finally:  # Ctrl-C may have come while it was written
                if database.execute("SELECT 1 FROM runs WHERE key = ?", [job.key]).fetchone():
                    self.done.add(job.key)

    def forget(self, job: Job) -> None:
        """Let a job be done again; its new record replaces the old one."""
        self.done.remove(job.key)

    def fail(self, job: Job, failure: Failure) -> None:
        """Keep why a job failed, unless many have; the next session does it again.

        Raises:
            Refused: As for `add`.
        """
        if failure.full:
            raise Refused(f"{failure.reason}; what is in {self.folder} is whole; {GOES_ON}")
        path = self.failure_path(job)
        if path.exists() or sum(1 for _ in path.parent.glob("*")) < MOST_FAILURES:
            self.write(f"{FAILURES}/{path.name}", FailureFile.of(job, failure.error).text())

    def write(self, name: str, content: bytes | str) -> Path:
        """Write another file of the study, and return its path.

        Raises:
            Refused: As for `add`.
        """
        with on_disk(self.folder, f"write {name}"):
            return atomic.write(self.folder, name, content)

    def export(self, table: pa.Table) -> list[Path]:
        """Write the runs as Parquet, for other programs, and return the paths of the files.

        Args:
            table: All rows, as `table` returns them; the series are added in a file of their own.

        Raises:
            Refused: As for `add`.
        """
        with (
            on_disk(self.folder, f"write {SERIES}"),
            atomic.writing(self.folder, SERIES) as file,
        ):
            writer = None
            for records in self._batches(long=True):
                rows = series_table(records)
                writer = writer or pq.ParquetWriter(file, rows.schema, write_page_checksum=True)
                writer.write_table(rows)
            if writer is not None:
                writer.close()
        return [self.write(RESULTS, parquet(table)), self.folder / SERIES]

    def failure_path(self, job: Job) -> Path:
        """Return the path of the file that says why a job failed."""
        return self.folder / FAILURES / f"{job.key}.json"

    @contextmanager
    def _opened(self, action: str = f"read {RUNS}") -> Generator[sqlite3.Connection]:
        """Yield the database; `action` and errors are those of `on_disk`."""
        with on_disk(self.folder, action):
            if self._database is not None:
                yield self._database
                return
            with closing(_readable(self.folder / RUNS)) as database:
                yield database


def _checksum(row: Sequence[Any]) -> int:
    """Return a checksum of values of a row, whatever types a damaged one has."""
    return zlib.crc32(repr(row).encode())
