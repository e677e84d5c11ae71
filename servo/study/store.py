"""The folder of a study, which keeps all finished runs even if the process is killed.

`study.json` describes the study. `runs.sqlite` has a row for each finished run, which is written to
the disk when this process gets the run's record. At the end the rows are exported to
`results.parquet` and `series.parquet`, for other programs. One process writes at a time; others may
read meanwhile.
"""

import errno
import os
import sqlite3
import zlib
from collections.abc import Generator, Iterable, Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, cast

import pyarrow as pa
import pyarrow.parquet as pq
from filelock import FileLock, Timeout

from servo.mistake import Mistake, Refused, check_rules, writing
from servo.output.formats import Document, Made, Number, OtherFormat
from servo.output.versions import RENDERING, SOURCE, versions
from servo.scenario.draws import leaves
from servo.scenario.toml import Table
from servo.study.plan import Study
from servo.study.record_file import parquet, record_of, series_table, stored, table_of
from servo.study.run import Failure, Job, Record
from tracking.files import atomic
from tracking.files.json_text import as_json

RUNS = "runs.sqlite"
BESIDE = ("", "-wal", "-shm", "-journal")
"""Endings of the files that SQLite writes for a database."""
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
"""A row has the key and the digest of a job, the record as `record_file.stored` returns it, and a
checksum of the other columns, because SQLite has none.
"""
FAILURES = "failures"
RESULTS = "results.parquet"
SERIES = "series.parquet"
LOCK = ".lock"
BATCH = 1000
"""Most records that are in memory at once when tables are made."""
NAMED = 3
"""Most differing settings that a message names."""
MOST_FAILURES = 40
"""Most files of failures in a folder."""
DECIDE = {
    "table": "settings",
    "axes": "axes",
    "draws": "drawn settings",
    "seeds": "seeds",
    "scenarios": "scenarios",
    "files": "files",
}
"""Keys of study.json that must be the same whenever a study is continued, and their names in
messages."""
GOES_ON = "the finished runs are stored; run the same command again to continue"
MENDED = "the finished runs are stored; remove the cause and run the same command again to continue"


@dataclass(frozen=True, slots=True, kw_only=True)
class StudyFile(Made):
    """The contents of the file study.json, which describes the study in a folder, with the command
    line that began it and the versions of packages. `draws` has the distribution of each drawn
    setting, {key: {name: numbers}}, and `scenarios` the scenarios' TOML tables by name.
    """

    FILE: ClassVar[str] = "study.json"
    KIND: ClassVar[str] = "study"
    FORMAT: ClassVar[int] = 2

    holds: str = "sweep"
    """Name of the command whose results are in the folder."""
    name: str
    title: str
    axes: dict[str, list[object]]
    draws: dict[str, dict[str, list[object]]]
    """For each drawn setting, the name of its distribution with its parameters or choices."""
    seeds: list[int]
    compare: str | None
    """The axis whose values are compared with each other."""
    expect: dict[str, Number]
    runs: int
    table: dict[str, Any]
    """The study's TOML table, including the changes of the command line."""
    scenarios: dict[str, dict[str, Any]]
    """Tables of the study's scenarios, by name."""
    files: dict[str, str] = field(default_factory=dict[str, str])
    """Digests of the files that these tables name, by path."""

    @staticmethod
    def of(study: Study, command: str) -> "StudyFile":
        """Return the contents of the file study.json for a study that a command line (`command`)
        begins, with the present versions of packages.
        """
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
    """The contents of the file failures/KEY.json in a study's folder, which describes a run that
    ended with an error: its number, settings, command line and traceback.

    The file is kept even if a later try of the run succeeds: it shows that the run does not repeat.
    """

    KIND: ClassVar[str] = "failure"

    run: int
    settings: Table
    command: str
    """Command line that repeats this run alone."""
    error: str
    """The traceback."""

    @staticmethod
    def of(job: Job, error: str) -> "FailureFile":
        """Return the contents of the file that describes a failed job; `error` is the traceback."""
        settings = job.settings | {"seed": job.seed}
        return FailureFile(run=job.number, settings=settings, command=job.command, error=error)


@contextmanager
def opened(folder: Path, described: StudyFile) -> Generator["Store"]:
    """Open the folder of a study for writing, yield its records as a `Store`, and keep the folder
    locked until the end of the block.

    A missing folder is made, and an empty one gets a study.json; a folder with other files but no
    study.json is refused.

    Args:
        folder: The study's folder.
        described: Contents of study.json of the study that this process begins or continues.

    Raises:
        Mistake: The folder cannot be written, has other files, a damaged study.json or database, or
            results of another command or study or of other versions, or another process is writing
            into it.
        Refused: The disk is full, or a file cannot be written.
    """
    with writing(folder):
        if folder.is_dir():
            _described(folder, described.holds)
        folder.mkdir(parents=True, exist_ok=True)
        lock = FileLock(folder / LOCK)
        try:
            lock.acquire(blocking=False)
        except Timeout:
            raise Mistake(
                f"{folder}: another command is writing into this folder: wait for its end, "
                "or choose another folder with --out"
            ) from None
    try:
        before = _described(folder, described.holds)
        if before is None:
            with on_disk(folder, f"write {described.FILE}"):
                described.write(folder)
        else:
            _check_same(folder, before, described)
        action = f"write {RUNS}"
        with on_disk(folder, action):
            database = _writable(folder / RUNS)
        with closing(database):
            with on_disk(folder, action):
                with suppress(sqlite3.OperationalError):  # not possible on network file systems
                    database.execute("PRAGMA journal_mode = WAL")
                database.execute("PRAGMA synchronous = FULL")
                database.execute(SCHEMA)
            yield Store(folder, database)
            # Put all rows into one file; another process that is reading may prevent this.
            with suppress(sqlite3.Error):
                database.execute("PRAGMA journal_mode = DELETE")
    finally:
        lock.release()


def _writable(path: Path) -> sqlite3.Connection:
    """Open the database of a study for writing; it is made if it is missing.

    Raises:
        OSError: The path is a link or no regular file.
        sqlite3.Error: The database cannot be opened.
    """
    for ending in BESIDE:
        file = path.with_name(path.name + ending)
        if file.is_symlink() or (file.exists() and not file.is_file()):
            why = f"{file.name} is a link or no regular file: remove it"
            raise OSError(errno.ELOOP, why, file)
    database = sqlite3.connect(path, isolation_level=None)
    database.text_factory = _text
    return database


def _readable(path: Path) -> sqlite3.Connection:
    """Open the database of a study for reading; another process may be writing into it.

    Raises:
        sqlite3.Error: The database cannot be opened.
    """
    # SQLite reads a database that was left in its WAL mode only where it can write files beside it.
    kind = "" if os.access(path.parent, os.W_OK) else "&immutable=1"
    database = sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro{kind}", uri=True)
    database.text_factory = _text
    return database


def _text(raw: bytes) -> str:
    """Decode a UTF-8 text of the database; invalid bytes, as in a damaged row, become the
    replacement character.
    """
    return raw.decode(errors="replace")


@contextmanager
def on_disk(folder: Path, action: str) -> Generator[None]:
    """Context manager that turns errors of the disk or the database in its block into exceptions
    with one sentence for the user.

    Args:
        folder: The study's folder.
        action: What the block does, for the sentence, such as "write run 000000".

    Raises:
        Mistake: The database is damaged.
        Refused: The disk is full, or the system refuses the action for another reason.
    """
    try:
        yield
    except (OSError, sqlite3.OperationalError) as error:
        reason = (isinstance(error, OSError) and error.strerror) or error
        raise Refused(f"{folder}: cannot {action}: {reason}; {MENDED}") from None
    except sqlite3.DatabaseError as error:
        raise Mistake(
            f"{folder / RUNS}: this file is damaged ({error}): do the runs again in another folder"
        ) from None


def _described(folder: Path, holds: str) -> StudyFile | None:
    """Read study.json in a folder; None if the folder is new.

    Args:
        folder: The study's folder.
        holds: Name of the command whose results it should have, for messages.

    Raises:
        Mistake: The folder has other files, or study.json is damaged or has the format of another
            version of servobench.
    """
    path = folder / StudyFile.FILE
    if not path.exists():
        # Files that a process leaves that was killed before it wrote study.json.
        begun = (LOCK, atomic.ASIDE.format(path.name))
        if any(there.name not in begun for there in folder.iterdir()):
            raise Mistake(
                f"{folder}: this folder has files, but no {path.name} of `servobench {holds}`; "
                "choose another folder with --out"
            )
        return None
    try:
        return StudyFile.read(path)
    except OtherFormat as error:
        raise Mistake(
            f"{error.fact}, so the runs in this folder cannot be used; choose another folder with "
            "--out"
        ) from None
    except Mistake:
        raise Mistake(
            f"{path}: this file is damaged, so the results beside it cannot be identified; "
            "choose another folder with --out"
        ) from None


def _names(before: object, now: object) -> str:
    """Return ": " and the dotted keys whose values differ between two tables, the first three of
    them; "" for values that are no tables.
    """
    if not (isinstance(before, dict) and isinstance(now, dict)):
        return ""
    old, new = (dict(leaves(cast(Table, as_json(table)))) for table in (before, now))
    keys = [key for key in {**new, **old} if old.get(key) != new.get(key)]
    return ": " + ", ".join(keys[:NAMED]) + (", ..." if len(keys) > NAMED else "")


def _check_same(folder: Path, before: StudyFile, now: StudyFile) -> None:
    """Check that a folder, whose study.json is `before`, has results of the same study, command and
    versions as `now`.

    Raises:
        Mistake: The folder has results of another one.
    """
    check_rules(
        (
            before.holds != now.holds,
            f"{folder}: this folder holds results of another command; choose another folder with "
            "--out",
        ),
        *(
            (
                as_json(getattr(before, what)) != as_json(getattr(now, what)),
                f"{folder}: this folder holds another study (its {words} differ"
                f"{_names(getattr(before, what), getattr(now, what))}); choose another folder with "
                "--out",
            )
            for what, words in DECIDE.items()
        ),
        *(
            (
                before.versions.get(name) != version,
                f"{folder}: {_since(name, before.versions.get(name), version)}: numbers may "
                "differ; choose another folder with --out",
            )
            for name, version in now.versions.items()
        ),
    )


def _since(name: str, before: str | None, now: str) -> str:
    """Return the beginning of a sentence: an entry of `versions` differs from that of stored
    results (None: they have no such entry).
    """
    if name == RENDERING and before is not None:
        return f"the pictures of these results are '{before}', and now they would be '{now}'"
    if name == SOURCE and before is not None:
        return (
            f"these results are of a source of servobench with digest {before}, and it is {now} now"
        )
    if before is None:
        return f"these results state no version of {name}, and {now} is installed now"
    return f"these results are of {name} {before}, and {now} is installed now"


def _elsewhere(name: str, there: str | None, here: str) -> str:
    """Return a sentence: an entry of `versions` differs from that of a worker (None: the worker has
    no such entry).
    """
    if name == RENDERING:
        return (
            f"the pictures of a worker are '{there}', and here they are '{here}': numbers may "
            'differ; install OpenGL on every worker and here, or set camera.renderer = "exact"'
        )
    if name == SOURCE:
        return (
            f"the source of servobench on a worker has digest {there}, and here it has {here}: "
            "numbers may differ; install the same source on every worker"
        )
    found = f"a worker lacks {name}" if there is None else f"a worker has {name} {there}"
    return (
        f"{found}, and {here} is installed here: numbers may differ; install the same version on "
        "every worker"
    )


class Store:
    """Store of the records (results of runs) in a study's folder: it finds, reads, adds and exports
    them. `done` has the keys of the jobs that have a valid record; it is filled by
    `find` and `add`. Without an open `database` the records are only read.
    """

    def __init__(self, folder: Path, database: sqlite3.Connection | None = None) -> None:
        """Use a study's folder; without an open `database` the store is for reading only."""
        self.folder = folder
        self.done: set[str] = set()
        """Keys of the jobs that have a record."""
        self.damaged: list[str] = []
        """Keys of rows that are damaged or belong to another job; these jobs are run again."""
        self._database = database

    def find(self, jobs: Iterable[Job] | None = None) -> None:
        """Find the records of some jobs, and check that they are undamaged and of these jobs. Set
        `done` to the keys of valid records, and `damaged` to those of the others.

        Args:
            jobs: The jobs; None: all that have a record, of whatever job.

        Raises:
            Mistake: The database is damaged.
            Refused: The database cannot be read.
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
        """Yield records of finished jobs, in the order of the keys; none if `done` is empty.

        Args:
            keys: Keys of the jobs, all in `done`.
            long: Whether the records include series over time and contact sheets (images with
                pictures of the run).

        Raises:
            Mistake: The database is damaged.
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
        """Return the records, with series over time and contact sheets (images with pictures of the
        run), of those jobs whose key is in `done`, in the order of `jobs`. Call `find` first.

        Raises:
            Mistake: The database is damaged.
            Refused: The database cannot be read.
        """
        return list(self.read([job.key for job in jobs if job.key in self.done], long=True))

    def table(self) -> pa.Table:
        """Return the Arrow table of results with a row for each job in `done`, of which there is at
        least one, ordered by key. Call `find` first.

        Raises:
            Mistake: The database is damaged.
            Refused: The database cannot be read.
        """
        return table_of(self._batches(long=False))

    def _batches(self, *, long: bool) -> Iterator[list[Record]]:
        keys = sorted(self.done)
        for first in range(0, len(keys), BATCH):
            yield list(self.read(keys[first : first + BATCH], long=long))

    def add(self, job: Job, record: Record) -> None:
        """Write the record of a job to the disk, and add the job's key to `done`. An older record
        of the job is replaced.

        Raises:
            Mistake: The worker that ran the job has other versions of packages or other source code
                of servobench than this process, or only one of the two renders without OpenGL; or
                the database is damaged.
            Refused: The disk is full, or the database cannot be written.
        """
        check_rules(
            *(
                (
                    record.versions.get(name) != here,
                    _elsewhere(name, record.versions.get(name), here),
                )
                for name, here in versions().items()
            )
        )
        row = [job.key, job.digest, *stored(record)]
        with self._opened(f"write run {job.key}") as database:
            database.execute(
                "INSERT OR REPLACE INTO runs VALUES (?, ?, ?, ?, ?, ?)", [*row, _checksum(row)]
            )
        self.done.add(job.key)

    def forget(self, job: Job) -> None:
        """Remove a job's key from `done`, so that the job is run again and its stored record is
        then replaced.

        Raises:
            KeyError: The key is not in `done`.
        """
        self.done.remove(job.key)

    def fail(self, job: Job, failure: Failure) -> None:
        """Write the file that describes a failed job, or replace the job's older one; no new file
        is written if the study's folder has 40 such files already. The job is run again when the
        study is continued.

        Raises:
            Refused: The disk is full, the machine had no room left in the job (`Failure.full`), or
                the file cannot be written.
        """
        if failure.full:
            raise Refused(f"{self.folder}: {failure.reason}; {MENDED}")
        path = self.failure_path(job)
        if path.exists() or sum(1 for _ in path.parent.glob("*")) < MOST_FAILURES:
            self.write(f"{FAILURES}/{path.name}", FailureFile.of(job, failure.error).text())

    def write(self, name: str, content: bytes | str) -> Path:
        """Write a file, such as a table or a report, into the study's folder, and return its path;
        an older one is replaced.

        Args:
            name: The file's name, or its path relative to the folder.
            content: The file's text or bytes.

        Raises:
            Refused: The disk is full, or the file cannot be written.
        """
        with on_disk(self.folder, f"write {name}"):
            return atomic.write(self.folder, name, content)

    def export(self, table: pa.Table) -> list[Path]:
        """Write results.parquet (the given table) and series.parquet (series over time and contact
        sheets of the jobs in `done`, read from the database); return their paths in this order.

        Args:
            table: The results, a row for each run, as `table` returns them.

        Raises:
            Mistake: The database is damaged.
            Refused: The disk is full, the database cannot be read, or a file cannot be written.
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
        """Return the path of the file that describes the error of a failed job; the file may not
        exist.
        """
        return self.folder / FAILURES / f"{job.key}.json"

    @contextmanager
    def _opened(self, action: str = f"read {RUNS}") -> Generator[sqlite3.Connection]:
        """Yield the open database; one that is not open is opened for reading. Errors in the block
        become the exceptions of `on_disk`, with the sentence about `action`.
        """
        with on_disk(self.folder, action):
            if self._database is not None:
                yield self._database
                return
            with closing(_readable(self.folder / RUNS)) as database:
                yield database


def _checksum(row: Sequence[object]) -> int:
    """Return the CRC-32 of the values of a database row, of any types."""
    return zlib.crc32(repr(row).encode())
