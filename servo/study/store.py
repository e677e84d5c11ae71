"""The folder of a study: what is finished stays, whatever is killed.

`study.json` says what is to be run; each finished run is a Parquet file of one row, written aside,
flushed to the disk and renamed; a lock keeps two studies from writing into one folder.
"""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any, TextIO

import pyarrow as pa
import pyarrow.parquet as pq

from servo.measures import MEANINGS
from servo.mistake import Mistake
from servo.study.perform import Row, version_columns
from servo.study.plan import Run, Study

MANIFEST, LOCK, RUNS, FAILURES = "study.json", "study.lock", "runs", "failures"
FLOATS, FLAGS = pa.list_(pa.float32()), pa.list_(pa.bool_())
SERIES = {"time_s": FLOATS, "servo_error_px": FLOATS, "tracking_error_px": FLOATS,
          "on_target": FLAGS, "sheet": pa.binary()}  # fmt: skip
"""Columns of a run's own file that are not in the table of all runs."""


def columns(study: Study) -> list[tuple[str, pa.DataType]]:
    """Names and types of the tidy table."""
    own = [(axis.key, axis.values) for axis in study.every_axis]
    own += [(d.key, d.numbers if d.law == "choice" else (0.5,)) for d in study.draws]
    fixed = [("run", pa.int64()), ("scenario", pa.string()), ("seed", pa.int64())]
    named = {name for name, _ in fixed}
    return [
        *fixed,
        *((key, _type(values)) for key, values in own if key not in named),
        ("outcome", pa.string()), ("success", pa.bool_()), ("missed", pa.string()),
        *((name, pa.float64()) for name in (*MEANINGS, "track_ms")),
        *((name, pa.string()) for name in version_columns()),
    ]  # fmt: skip


class Store:
    """A study's folder, for one who writes; close it."""

    def __init__(self, folder: Path, study: Study, manifest: dict[str, Any]) -> None:
        """Make the folder, or go on in it.

        Raises:
            Mistake: It cannot be written, holds something else, or somebody is writing there.
        """
        self.folder = folder
        self._lock: TextIO | None = None
        own = columns(study)
        self._schema = pa.schema([*own, *SERIES.items()])
        self._names = [name for name, _ in own]
        try:
            self._on_disk(lambda: self._open(manifest), "the folder")
        except Mistake:
            self.close()
            raise

    def _open(self, manifest: dict[str, Any]) -> None:
        for part in (RUNS, FAILURES):
            (self.folder / part).mkdir(parents=True, exist_ok=True)
        self._lock = (self.folder / LOCK).open("w")
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise Mistake(f"{self.folder}: another sweep is writing into this folder") from None
        path = self.folder / MANIFEST
        if path.exists():
            self._compare(path, manifest)
        else:
            _write(path, (json.dumps(manifest, indent=1) + "\n").encode())

    def _compare(self, path: Path, manifest: dict[str, Any]) -> None:
        try:
            before = json.loads(path.read_text(encoding="utf-8"))
        except ValueError:
            raise Mistake(f"{path}: this is no study's description") from None
        now = json.loads(json.dumps(manifest))
        for what in ("table", "axes", "draws", "seeds", "scenarios"):
            if before.get(what) != now[what]:
                raise Mistake(
                    f"{self.folder}: another study is kept here (its {what} differs); "
                    "choose another folder with --out"
                )
        for name, version in now["versions"].items():
            old = before["versions"].get(name)
            if old != version:
                raise Mistake(
                    f"{self.folder}: this study was begun with {name} {old}, here is {version}: "
                    "its numbers would not compare; choose another folder with --out"
                )

    def done(self) -> set[int]:
        """Numbers of the runs that are finished."""
        found: set[int] = set()
        for path in (self.folder / RUNS).glob("*.parquet"):
            with suppress(pa.ArrowInvalid, OSError, ValueError):  # a file of zeros after a crash
                pq.read_metadata(path)
                found.add(int(path.stem))
        return found

    def add(self, row: Row) -> None:
        """Keep a finished run.

        Raises:
            Mistake: The disk is full, or otherwise refuses.
        """
        told = {f.name: _cell(row.get(f.name), f.type) for f in self._schema}
        sink = pa.BufferOutputStream()
        pq.write_table(pa.Table.from_pylist([told], self._schema), sink)
        path = self.folder / RUNS / f"{row['run']:06}.parquet"
        self._on_disk(lambda: _write(path, sink.getvalue().to_pybytes()), f"run {row['run']}")
        with suppress(FileNotFoundError):
            self._failure(row["run"]).unlink()

    def fail(self, run: Run, error: str, command: str) -> Path:
        """Keep why a run failed; it is tried again when the study goes on.

        Raises:
            Mistake: As for `add`.
        """
        told = {"run": run.number, "settings": run.settings | {"seed": run.seed},
                "command": command, "error": error}  # fmt: skip
        path = self._failure(run.number)
        text = json.dumps(told, indent=1) + "\n"
        self._on_disk(lambda: _write(path, text.encode()), f"run {run.number}")
        return path

    def table(self, numbers: Iterable[int]) -> pa.Table:
        """The tidy table of finished runs, in their order."""
        paths = [self.folder / RUNS / f"{n:06}.parquet" for n in sorted(numbers)]
        return pa.concat_tables([pq.read_table(p, columns=self._names) for p in paths])

    def write(self, name: str, content: bytes) -> Path:
        """Write another file of the study as a whole.

        Raises:
            Mistake: As for `add`.
        """
        path = self.folder / name
        self._on_disk(lambda: _write(path, content), name)
        return path

    def close(self) -> None:
        """Let others write."""
        if self._lock is not None:
            self._lock.close()

    def __enter__(self) -> Store:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:  # fmt: skip
        self.close()

    def _failure(self, number: int) -> Path:
        return self.folder / FAILURES / f"{number:06}.json"

    def _on_disk(self, act: Callable[[], None], what: str) -> None:
        try:
            act()
        except OSError as error:
            raise Mistake(
                f"{self.folder}: cannot write {what}: {error.strerror}; what is there already is "
                "whole, and the same command goes on from it"
            ) from None


def _write(path: Path, content: bytes) -> None:
    """As a whole or not at all, even if the power fails."""
    aside = path.with_name(f".{path.name}.part")
    with aside.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())
    aside.replace(path)
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)


def _cell(value: Any, kind: pa.DataType) -> Any:
    """Values of an axis that have nothing in common are kept as words."""
    return value if kind != pa.string() or value is None else str(value)


def _type(values: Iterable[Any]) -> pa.DataType:
    kinds = {type(v) for v in values}
    if kinds == {bool}:
        return pa.bool_()
    if kinds == {int}:
        return pa.int64()
    return pa.float64() if kinds <= {int, float} else pa.string()
