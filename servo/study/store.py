"""The folder of a study, in which finished runs stay when a process is killed.

`study.json` describes the study. Each finished run is a Parquet file of one row, which is written
under another name, flushed to the disk and renamed. A file that is not the row of its run counts as
missing.
"""

from __future__ import annotations

from collections.abc import Generator, Iterable
from contextlib import contextmanager, suppress
from pathlib import Path

import pyarrow as pa

from servo.mistake import Mistake, Refused
from servo.output.result_folder import check_versions, only_writer
from servo.study.perform import Row, RunFiles, version_columns
from servo.study.plan import FailureFile, Run, Study, StudyFile
from tracking.files import atomic
from tracking.files.json_text import as_json

RUNS = "runs"
FAILURES = "failures"
RESULTS = "results.parquet"
DECIDE = ("table", "axes", "draws", "seeds", "scenarios", "files")
"""Keys of study.json that must not differ between the sessions of one study."""


@contextmanager
def opened(folder: Path, study: Study, described: StudyFile) -> Generator[Store]:
    """The store of a study in a folder, which is made if it is not there; one process may write
    into it until the block ends.

    Raises:
        Mistake: The folder cannot be written or holds something else, or another process is
            writing into it.
    """
    with only_writer(folder, StudyFile, "sweep", own=(RUNS, FAILURES)) as before:
        yield Store(folder, study, before, described)


class Store:
    """A study's folder, for one writer."""

    def __init__(
        self, folder: Path, study: Study, before: StudyFile | None, now: StudyFile
    ) -> None:
        self.folder = folder
        self._study = study
        self._files = RunFiles(study)
        self.damaged: list[Path] = []
        """Files that do not hold the run of their name; these runs are repeated."""
        self._compare(before, now)
        with self._on_disk("the folder"):
            for part in (RUNS, FAILURES):
                atomic.folder(folder, part)
        self._done = self._checked()

    def _compare(self, before: StudyFile | None, now: StudyFile) -> None:
        if before is None:
            with self._on_disk(now.FILE):
                now.write(self.folder)
            return
        for what in DECIDE:
            if as_json(getattr(before, what)) != as_json(getattr(now, what)):
                raise Mistake(
                    f"{self.folder}: this folder holds another study (its {what} differs); "
                    "choose another folder with --out"
                )
        check_versions(self.folder, before.versions, now.versions)

    def _checked(self) -> set[int]:
        """Numbers of the runs whose file is whole and holds their row."""
        there = {path.name for path in (self.folder / RUNS).glob("*.parquet")}
        done: set[int] = set()
        runs = (r for r in self._study.runs() if _name(r.number) in there) if there else ()
        for run in runs:
            path = self.folder / RUNS / _name(run.number)
            table = self._files.read(path)
            if table is not None and self._files.fits(table, run):
                done.add(run.number)
            else:
                self.damaged.append(path)
            there.remove(path.name)
        self.damaged += [self.folder / RUNS / name for name in sorted(there)]
        return done

    def done(self) -> set[int]:
        """Numbers of the runs that are finished."""
        return set(self._done)

    def add(self, row: Row) -> None:
        """Store the row of a finished run.

        Raises:
            Mistake: The worker has other versions.
            Refused: The disk is full, or the file cannot be written.
        """
        number = int(row["run"])
        for column, here in version_columns().items():
            if row.get(column) != here:
                name = column.removeprefix("version_")
                raise Mistake(
                    f"a worker has {name} {row.get(column)}, but {here} is installed here: the "
                    "numbers could not be compared; install the same on every worker"
                )
        path = self.folder / RUNS / _name(number)
        encoded = self._files.encoded(row)
        try:
            with self._on_disk(f"run {number}"):
                atomic.write(path.parent, path.name, encoded)
            self._done.add(number)
        except KeyboardInterrupt:
            if path.is_file() and path.read_bytes() == encoded:  # interrupted after the renaming
                self._done.add(number)
            raise
        with suppress(OSError):
            self._failure(number).unlink()

    def fail(self, run: Run, error: str, command: str) -> Path:
        """Store why a run failed; the next session runs it again.

        Raises:
            Refused: As for `add`.
        """
        path = self._failure(run.number)
        with self._on_disk(f"run {run.number}"):
            return FailureFile.of(run, error, command).write(path.parent, path.name)

    def table(self, numbers: Iterable[int]) -> pa.Table:
        """The table of finished runs, a row for each, in their order.

        Raises:
            Refused: A file has changed since it was checked.
        """
        tables: list[pa.Table] = []
        for number in sorted(numbers):
            path = self.folder / RUNS / _name(number)
            table = self._files.read(path)
            if table is None:
                raise Refused(f"{path}: this file was changed; the same command repeats the run")
            tables.append(table)
        return pa.concat_tables(tables)

    def write(self, name: str, content: bytes | str) -> Path:
        """Write another file of the study; its path.

        Raises:
            Refused: As for `add`.
        """
        with self._on_disk(name):
            return atomic.write(self.folder, name, content)

    def _failure(self, number: int) -> Path:
        return self.folder / FAILURES / f"{number:06}.json"

    @contextmanager
    def _on_disk(self, what: str) -> Generator[None]:
        try:
            yield
        except OSError as error:
            raise Refused(
                f"{self.folder}: cannot write {what}: {error.strerror}; what is there already is "
                "whole, and the same command goes on from it"
            ) from None


def _name(number: int) -> str:
    return f"{number:06}.parquet"
