"""The results of a study: means with 95 % intervals, and paired comparisons of axis values.

A cell is one combination of axis values. A unit is an independent observation: a scenario if the
rows are of several scenarios, else a seed, which has the same drawn settings in all cells. If seeds
change nothing but computing times, all runs together are one observation.
"""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from servo.loop.measure import COUNTED, MEASURES, TIMED
from servo.scenario.expected import SUCCESS_RATE
from servo.scenario.toml import Table
from servo.study.plan import Study
from servo.study.run import SCENARIO, RunRow, grouped_by
from servo.study.scenario_run import MEASURED, RECORDED, TRACK_MS
from sim.types import Array
from tracking.files.csv_text import csv_text
from tracking.statistics.comparisons import (
    Interval,
    McNemar,
    cells,
    mean_of,
    mean_percent,
    pairs_of,
    titles,
)

SUCCESS = "success"
UNTIMED = tuple(name for name, measure in MEASURES.items() if not measure.timed)
SHOWN = ("servo_rms_px", "servo_peak_px", "tracking_rms_px", TRACK_MS)
"""Measures that a table shows if no measure differs between the cells."""
MOST_MOVED = 5
"""Most measures in a table."""
LEAST_MOVED = 0.05
"""Least difference between cells that a table shows, as a share of the largest mean."""
ALIKE = 0.98
"""Absolute correlation over the cells above which a table shows only one of two measures."""
COMPARED = ("first", "second", "unit", "wins", "losses", "ties", "z", "p", "p_holm")
_Held = dict[Any, dict[tuple[object, ...], bool]]
"""Success of runs by unit, and by scenario, other axes' values and seed."""


@dataclass(frozen=True, slots=True)
class Units:
    """The rows of a table of a study's results, grouped by unit (independent observation): by
    scenario, by seed, or all in one group. `name` is "scenario", "draw" (a seed with drawn
    settings), "seed" or "run" (one group).
    """

    name: str
    """Kind of the units: scenario, draw (a seed with drawn settings), seed, or run (all runs are
    one observation)."""
    rows: dict[Any, list[RunRow]]
    """Rows by unit."""

    @staticmethod
    def of(rows: Sequence[RunRow], keys: Collection[str], drawn: bool, apart: str = "") -> "Units":
        """Group the result rows of a study's runs by unit (independent observation): by scenario if
        there are several; else by seed, or all together if no setting is drawn and seeds change
        nothing but computing times.

        Args:
            rows: Rows of runs: values by column.
            keys: Names of the study's axes.
            drawn: Whether the study has drawn settings.
            apart: Axis whose values are compared, "" for none; "scenario" prevents grouping by
                scenario.
        """
        if apart != SCENARIO and len({row.get(SCENARIO) for row in rows}) > 1:
            return Units("scenario", _by(rows, [SCENARIO]))
        # Seeds count if two of them differ in more than a computing time.
        cells = _by(rows, [SCENARIO, *keys]).values()
        if drawn or any(len(_by(cell, ["outcome", *UNTIMED])) > 1 for cell in cells):
            return Units("draw" if drawn else "seed", _by(rows, ["seed"]))
        return Units("run", {(): list(rows)} if rows else {})

    def mean(self, name: str) -> Interval | None:
        """Return the mean of a measure over the units (independent observations), with its 95 %
        interval; None if no run has a finite value.

        The value of a unit is the mean over its runs with a finite value; units without such a run
        are left out. Values are in the measure's unit; `name` may also be "success", whose mean is
        the success rate from 0 to 1.
        """
        scores = [found.mean() for rows in self.rows.values() if len(found := values(rows, name))]
        if not scores:
            return None
        measure = RECORDED.get(name)
        if measure is not None and measure.share:
            return mean_percent(np.array(scores) / 100)
        least = -np.inf if measure is not None and measure.signed else 0.0
        return mean_of(np.array(scores), least=least, most=1.0 if name == SUCCESS else np.inf)


def values(rows: Iterable[RunRow], name: str) -> Array:
    """Return the finite values (n,) of a measure in the rows that have one, in the measure's unit
    and the order of the rows.
    """
    found = np.array([r[name] for r in rows if r.get(name) is not None], dtype=float)
    return found[np.isfinite(found)]


def uncounted(rows: Sequence[RunRow]) -> str:
    """Return a sentence if no run reached the setting measure.after, the time from which on errors
    count, so that measures of errors have no value; else, or without rows, "".
    """
    if not rows or any(len(values(rows, name)) for name in COUNTED):
        return ""
    return "No run reaches the time measure.after: measures from this time on have no value."


def _by(rows: Iterable[RunRow], keys: Sequence[str]) -> dict[Any, list[RunRow]]:
    """Group rows by the tuple of their values in some columns."""
    return grouped_by(rows, lambda row: tuple(row.get(key) for key in keys))


@dataclass(frozen=True, slots=True)
class Cell:
    """The results of the runs with one combination of axis values (`settings`, by axis): number of
    runs, success rate (0 to 1) and mean measures by name, each with its 95 % interval, and the
    number of runs in which each measure is finite.
    """

    settings: Table
    """Axis values by name of the axis."""
    runs: int
    """Number of runs."""
    unit: str
    """Kind of the units over which intervals are taken (`Units.name`)."""
    success: Interval | None
    """Share of successful runs in each unit, from 0 to 1, averaged over the units."""
    means: dict[str, Interval]
    """Means of the measures over the units (see `Units.mean`); measures without a finite value are
    left out."""
    finite: dict[str, int]
    """Number of runs in which the measure is finite, by measure."""

    @staticmethod
    def of(settings: Table, rows: Sequence[RunRow], *, drawn: bool) -> "Cell":
        """Return the results of the runs with one combination of axis values.

        Args:
            settings: Axis values by name of the axis.
            rows: Rows of these runs in a table of results, at least one.
            drawn: Whether the study has drawn settings. Each seed is then one independent
                observation; otherwise it is one only if seeds change the results. Rows of several
                scenarios have one observation for each scenario.
        """
        units = Units.of(rows, settings, drawn)
        found = {name: units.mean(name) for name in MEASURED}
        means = {name: mean for name, mean in found.items() if mean is not None}
        finite = {name: len(values(rows, name)) for name in MEASURED}
        return Cell(settings, len(rows), units.name, units.mean(SUCCESS), means, finite)


@dataclass(frozen=True, slots=True)
class Compared:
    """McNemar's test of the success of two values of an axis, such as two trackers, over pairs of
    runs that differ in nothing else, with its p value after Holm's correction. `unit` is the kind
    of independent observation that is counted, such as "seed".
    """

    first: object
    second: object
    unit: str
    """Kind of the units that are counted (`Units.name`)."""
    test: McNemar
    """Numbers of units in which the first, the second, or neither value succeeded more often."""
    p_holm: float
    """The exact p value, corrected for the number of comparisons (Holm)."""

    @property
    def cells(self) -> list[object]:
        """Return this comparison as a row of a table: first and second value of the axis, kind of
        the independent observations (such as "seed"), wins, losses and ties of the first value
        (numbers of such observations), statistic z (at least 0) and exact p value of McNemar's
        test, and that p value after Holm's correction.
        """
        t = self.test
        return [self.first, self.second, self.unit, t.wins, t.losses, t.ties, t.z, t.p, self.p_holm]


def grouped(keys: Sequence[str], rows: Iterable[RunRow]) -> list[tuple[Table, list[RunRow]]]:
    """Group rows of a table of results by their values in the columns `keys`, such as axes.

    Returns:
        For each combination of values: the values by column, and the rows that have them. Both
        combinations and rows are in the order of `rows`.
    """
    groups = _by(rows, keys)
    return [(dict(zip(keys, at, strict=True)), group) for at, group in groups.items()]


def cells_of(study: Study, rows: Iterable[RunRow]) -> list[Cell]:
    """Return the results of each combination of axis values that has rows, in the order of the
    rows.

    Args:
        study: The study.
        rows: Rows of its table of results, one for each run.
    """
    return [
        Cell.of(settings, group, drawn=bool(study.draws))
        for settings, group in grouped(study.keys, rows)
    ]


def moved(cells: Sequence[Cell]) -> list[str]:
    """Return the names of up to five measures whose means differ most between combinations of axis
    values (`cells`), in the order of `MEASURED`. If none differs, return "servo_rms_px",
    "servo_peak_px", "tracking_rms_px" and "track_ms".

    The difference of a measure is the range of its means, as a share of the largest one; a share of
    at most 5 % counts as none. The five measures are those with the largest share relative to the
    width of the means' 95 % intervals. Of measures whose correlation is above 0.98 or below -0.98,
    such as rms and peak of one error, only the first is chosen, if there are more than two cells
    (any two are in a line). "step_ms", and a measure without a mean in one of the cells, are never
    chosen.
    """
    scores: dict[str, float] = {}
    values: dict[str, Array] = {}
    for name in MEASURED:
        means = [cell.means[name] for cell in cells if name in cell.means]
        if name == TIMED or len(means) < max(2, len(cells)):
            continue
        values[name] = np.array([mean.value for mean in means])
        largest = float(np.abs(values[name]).max()) or 1.0
        share = float(np.ptp(values[name])) / largest
        if share <= LEAST_MOVED:
            continue
        noise = float(np.mean([m.high - m.low if m.known else 0.0 for m in means])) / largest
        score = share / (noise + LEAST_MOVED)
        alike = [
            other
            for other in scores
            if len(cells) > 2 and abs(np.corrcoef(values[name], values[other])[0, 1]) > ALIKE
        ]
        first = alike[0] if alike else name
        scores[first] = max(score, scores.get(first, 0.0))
    chosen = sorted(scores, key=lambda name: -scores[name])[:MOST_MOVED]
    return [name for name in MEASURED if name in (chosen or SHOWN)]


def comparisons(
    key: str | None, axes: Sequence[str], rows: Sequence[RunRow], *, drawn: bool = False
) -> list[Compared]:
    """Compare every pair of values of an axis by McNemar's test on success, with Holm's correction
    for the number of pairs; the success rate of the first value of a pair is at least that of the
    second.

    A value wins in a unit (independent observation, such as a seed) if it has the higher success
    rate there, over the runs that both values have: those of the same scenario, seed and values of
    the other axes.

    Args:
        key: Name of the compared axis; None: return an empty list.
        axes: Names of all axes.
        rows: Rows of the study's runs: values by column.
        drawn: Whether the study has drawn settings.
    """
    if key is None:
        return []
    units = Units.of(rows, axes, drawn, apart=key)
    others = [*(axis for axis in axes if axis != key), "seed"]
    held: dict[Any, _Held] = {}
    for unit, group in units.rows.items():
        for row in group:
            at = tuple(row.get(k) for k in others)
            held.setdefault(row[key], {}).setdefault(unit, {})[at] = row["success"]
    names = sorted(held, key=lambda n: -_rate(held[n]))
    pairs = pairs_of(names, lambda first, second: _mcnemar(held[first], held[second]))
    return [Compared(a, b, units.name, test, p) for a, b, test, p in pairs]


def cells_csv(study: Study, found: Sequence[Cell]) -> str:
    """Return a CSV text with a line for each combination of axis values (`found`).

    Columns are the axes, number of runs, kind of independent observation, the success rate (0 to 1)
    and the mean of each measure with the ends of its 95 % interval and the number of observations,
    and the number of runs in which each measure is finite.
    """
    lines = [
        [
            *(cell.settings[k] for k in study.keys),
            cell.runs,
            cell.unit,
            *cells([cell.success, *map(cell.means.get, MEASURED)]),
            *(cell.finite[name] for name in MEASURED),
        ]
        for cell in found
    ]
    intervals = titles([SUCCESS_RATE, *MEASURED])
    finite = [f"{name}_runs" for name in MEASURED]
    return csv_text([*study.keys, "runs", "unit", *intervals, *finite], lines)


def _rate(held: _Held) -> float:
    """Return the success rate, from 0 to 1: the share of successful runs in each unit (independent
    observation), averaged over the units.
    """
    return float(np.mean([np.mean(list(unit.values())) for unit in held.values()]))


def _mcnemar(first: _Held, second: _Held) -> McNemar:
    """Compare the success rates of two values of an axis in each unit (independent observation),
    over the runs that both values have.
    """
    units = first.keys() & second.keys()
    common = {unit: first[unit].keys() & second[unit].keys() for unit in units}
    rates = [
        [np.mean([held[unit][at] for at in both]) for held in (first, second)]
        for unit, both in common.items()
        if both
    ]
    return McNemar.of(*np.array(rates, float).reshape(-1, 2).T)
