"""A study's folder as values: the study, and rows, errors over time and sheets of its runs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
from numpy.typing import NDArray

from servo.report import files
from servo.study.perform import CAMERA, CORNERS
from servo.study.plan import FailureFile, StudyFile
from servo.study.store import FAILURES, RESULTS, RUNS
from servo.study.units import SUCCESS, Units, values
from sim.types import Array
from tracking.statistics.comparisons import Interval

SERIES = ("servo_error_px", "tracking_error_px", "on_target", *CAMERA, *CORNERS)
SHEET = "sheet"
TIME = "time_s"
NEEDED = ("run", "outcome", SUCCESS)
Row = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Series:
    """Values of a run over time; those that were not stored are missing."""

    time: Array
    """(n,) [s]."""
    values: dict[str, Array]
    """Values (n,) by name."""

    @property
    def duration(self) -> float:
        """When the run ended [s]: its last frame lasts as long as the others."""
        return float(self.time[-1] + (np.median(np.diff(self.time)) if len(self.time) > 1 else 0))


@dataclass(frozen=True, slots=True)
class StudyResults:
    """The content of a folder; sheets are read only when they are shown."""

    folder: Path
    plan: StudyFile
    rows: list[Row]
    series: dict[int, Series]
    """Values over time by the number of the run."""
    failures: list[FailureFile]
    broken: int
    """Number of run files that cannot be read, as after a crash; these runs count as missing."""

    @property
    def axes(self) -> dict[str, list[Any]]:
        """The axes that have several values and are columns of the rows."""
        return {
            key: values
            for key, values in self.plan.axes.items()
            if len(values) > 1 and all(key in row for row in self.rows[:1])
        }

    @property
    def compared(self) -> str | None:
        """The axis whose values are drawn in different colours."""
        if self.plan.compare in self.axes:
            return self.plan.compare
        return next(iter(self.axes), None)

    def units(self, rows: list[Row]) -> Units:
        """What the intervals of these rows are over."""
        return Units.of(rows, self.axes, bool(self.plan.draws))

    def interval(self, rows: list[Row], name: str) -> Interval | None:
        """Mean of a measure with its 95 % interval over the units; None if no run has it."""
        return self.units(rows).mean(name)

    def groups(self, key: str | None) -> dict[str, list[Row]]:
        """The rows by value of an axis, in the order of the axis; one group if there is no axis."""
        if key is None:
            return {"all runs": self.rows} if self.rows else {}
        found = {str(v): [r for r in self.rows if same(r[key], v)] for v in self.axes[key]}
        return {name: rows for name, rows in found.items() if rows}

    def sheets(self, most: int) -> Iterator[tuple[Row, bytes]]:
        """Rows with their contact sheets; first those of runs that did not succeed."""
        shown = 0
        for row in sorted(self.rows, key=lambda r: (bool(r[SUCCESS]), r["run"])):
            kept = _kept(_path(self.folder, row["run"]), [SHEET])
            picture = kept[0].get(SHEET) if kept else None
            if picture is not None:
                yield row, picture
                shown += 1
                if shown == most:
                    return


def load(folder: Path) -> StudyResults:
    """The content of a study's folder, also if the study is not finished.

    Raises:
        Mistake: A file is missing or damaged.
    """
    plan = StudyFile.read(folder / StudyFile.FILE)
    numbers = sorted(int(p.stem) for p in (folder / RUNS).glob("*.parquet") if p.stem.isdecimal())
    rows: list[Row] = []
    series: dict[int, Series] = {}
    broken = 0
    for number in numbers:
        kept = _kept(_path(folder, number), None)
        if kept is None or not all(name in kept[0] for name in NEEDED):
            broken += 1
            continue
        rows.append(kept[0])
        if kept[1] is not None:
            series[number] = kept[1]
    if (folder / RESULTS).exists():
        rows = files.table(folder / RESULTS).to_pylist()
    failed = [FailureFile.read(p) for p in sorted((folder / FAILURES).glob("*.json"))]
    return StudyResults(folder, plan, rows, series, failed, broken)


def same(found: Any, value: Any) -> bool:
    """Whether a cell is a value of an axis; columns of mixed types hold texts."""
    return found == value or str(found) == str(value)


def median(rows: list[Row], name: str) -> float:
    """Median of a measure; nan if no run has it."""
    found = values(rows, name)
    return float(np.median(found)) if len(found) else np.nan


def _path(folder: Path, number: int) -> Path:
    return folder / RUNS / f"{number:06}.parquet"


def _kept(path: Path, columns: list[str] | None) -> tuple[Row, Series | None] | None:
    """The short columns of a run's file and its values over time; None if it cannot be read."""
    try:
        schema = pq.read_schema(path)
        every = [n for n in schema.names if n != SHEET] if columns is None else columns
        table = pq.read_table(path, columns=[n for n in every if n in schema.names])
    except (ValueError, OSError):  # damaged by a crash
        return None
    long = [name for name in (TIME, *SERIES) if name in table.column_names]
    rows = table.drop_columns(long).to_pylist() if table.num_rows else []
    arrays = {name: _array(table[name]) for name in long if table.num_rows}
    time = arrays.pop(TIME, np.zeros(0))
    alike = {name: found for name, found in arrays.items() if len(found) == len(time) > 0}
    return (rows[0] if rows else {}), (Series(time, alike) if alike else None)


def _array(column: Any) -> NDArray[np.float64]:
    """The list in the only row (n,)."""
    listed = column[0]
    if not listed.is_valid:
        return np.zeros(0)
    return np.asarray(listed.values.to_numpy(zero_copy_only=False), float)
