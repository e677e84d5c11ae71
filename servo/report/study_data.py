"""The results of a study, read from its folder: a row of values for each run, errors over time, and
contact sheets.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from servo.report.words import counted, shown, spread
from servo.study.record_file import rows_of
from servo.study.results import SUCCESS, Cell, Units, values
from servo.study.run import RunRow, key_of
from servo.study.store import FAILURES, FailureFile, Store, StudyFile
from sim.types import Array

TIME = "time_s"
MOST_OVER_TIME = 4000
"""Most runs whose values over time are read."""

Series = dict[str, Array]
"""Values of a run over time (n,) by name; those of `TIME` are [s]."""


@dataclass(frozen=True, slots=True)
class StudyResults:
    """The results of a study (the runs of one or more scenarios over axes of settings and seeds),
    read from its folder: a row of values for each finished run; values over time of at most
    `MOST_OVER_TIME` runs; and the errors of runs that failed, and of those that finished when they
    were tried again (`retried`). Contact sheets are read when they are asked for.
    """

    store: Store
    plan: StudyFile
    rows: list[RunRow]
    series: dict[int, Series]
    """Values over time by the number of the run, of at most `MOST_OVER_TIME` runs."""
    pictured: set[int]
    """Numbers of the runs that have a contact sheet, among those whose values over time were
    read."""
    failures: list[FailureFile]
    """Errors of runs that failed and have no row."""
    retried: list[FailureFile]
    """Errors of runs that failed first and finished when they were tried again."""

    @property
    def axes(self) -> dict[str, list[Any]]:
        """Values of each axis of the study, by the axis's name: the dotted key of a setting,
        "scenario", or the name of an axis of groups of settings. Axes with a single value are left
        out.
        """
        return {
            key: values
            for key, values in self.plan.axes.items()
            if len(values) > 1 and all(key in row for row in self.rows[:1])
        }

    @property
    def compared(self) -> str | None:
        """Key of the axis whose values have different colours in figures: the one that the study
        compares, or else the first axis; None without an axis.
        """
        if self.plan.compare in self.axes:
            return self.plan.compare
        return next(iter(self.axes), None)

    def units(self, rows: list[RunRow]) -> Units:
        """Return rows of runs, grouped by independent repetitions, over which intervals are
        computed: by scenarios, random draws or seeds, or else all runs together.
        """
        return Units.of(rows, self.axes, bool(self.plan.draws))

    def groups(self, key: str | None) -> dict[str, list[RunRow]]:
        """Return the rows of the runs, by the values (as texts) of an axis, in the axis's order. A
        value without a finished run has an empty list.

        Args:
            key: Name of one of `axes`; None: all rows are in one group, "all runs".
        """
        if key is None:
            return {"all runs": self.rows}
        return {str(v): [r for r in self.rows if has_value(r, key, v)] for v in self.axes[key]}

    def sheets(self, most: int) -> Iterator[tuple[RunRow, bytes]]:
        """Yield up to `most` runs that have a contact sheet, each as its row and the sheet (bytes
        of an encoded picture); first those that did not succeed.
        """
        pictured = [row for row in self.rows if row["run"] in self.pictured]
        for row in sorted(pictured, key=lambda r: (bool(r[SUCCESS]), r["run"]))[:most]:
            (record,) = self.store.read([key_of(row["run"])], long=True)
            if record.sheet is not None:
                yield row, record.sheet


def has_value(row: RunRow, key: str, value: object) -> bool:
    """Return whether a run has a value of an axis. Values of an axis that are lists, or of several
    types, are texts in the rows.
    """
    return row[key] in (value, str(value))


def load(folder: Path) -> StudyResults:
    """Return the results in a study's folder, also if the study is not finished.

    Raises:
        Mistake: A file is missing or damaged.
        Refused: The database of the study cannot be read.
    """
    plan = StudyFile.read(folder / StudyFile.FILE)
    store = Store(folder)
    store.find()
    rows = rows_of(store.table()) if store.done else []
    draw = np.random.default_rng(0)
    # Runs of the first seed have contact sheets and are drawn one by one.
    chosen = sorted(rows, key=lambda row: (row["seed"] != plan.seeds[0], draw.random()))
    keys = [key_of(row["run"]) for row in chosen[:MOST_OVER_TIME]]
    series: dict[int, Series] = {}
    pictured: set[int] = set()
    for record in store.read(keys, long=True):
        if TIME in record.series:
            length = len(record.series[TIME])
            series[record.number] = {n: v for n, v in record.series.items() if len(v) == length}
        if record.sheet is not None:
            pictured.add(record.number)
    finished = {row["run"] for row in rows}
    failed, retried = list[FailureFile](), list[FailureFile]()
    for path in sorted((folder / FAILURES).glob("*.json")):
        failure = FailureFile.read(path)
        (retried if failure.run in finished else failed).append(failure)
    return StudyResults(store, plan, rows, series, pictured, failed, retried)


def missing(plan: StudyFile, store: Store) -> list[str]:
    """Return sentences on what a study lacks: the number of finished runs if it is not finished,
    and the number of damaged runs if there are any. The list is empty for a complete study.

    Args:
        plan: Description of the study.
        store: The study's folder, after `Store.find`.
    """
    found = list[str]()
    if len(store.done) < plan.runs:
        found.append(f"This study is not finished: {len(store.done)} of {plan.runs} runs.")
    if store.damaged:
        found.append(f"Runs that are damaged: {len(store.damaged)}.")
    return found


def duration(series: Series) -> float:
    """Return the duration of a run [s] from the times of its frames ("time_s"); the last frame
    counts as long as the median interval between two frames, or 0 if it is the only one.
    """
    time = series[TIME]
    return float(time[-1] + (np.median(np.diff(time)) if len(time) > 1 else 0))


def median(rows: list[RunRow], name: str) -> float:
    """Return the median of a measure over the runs in which it has a finite value; nan if there is
    none.

    Args:
        rows: Rows of the runs.
        name: Name of the measure.
    """
    found = values(rows, name)
    return float(np.median(found)) if len(found) else np.nan


def cell_row(cell: Cell, measures: Iterable[str]) -> list[str]:
    """Return a row of a study's table as texts, for one cell (a combination of axis values): the
    axis values, the number of independent repetitions, the success rate with its 95 % interval, and
    the means of the measures.

    A mean over a part of the runs is followed by their number: "2.1 (1 of 10)".
    """
    means: list[str] = []
    for name in measures:
        mean = cell.means.get(name)
        part = f" ({cell.finite[name]} of {cell.runs})" if cell.finite[name] < cell.runs else ""
        means.append(shown(mean.value) + part if mean else shown(None))
    axes = map(shown, cell.settings.values())
    return [*axes, counted(cell.success, cell.unit), spread(cell.success), *means]
