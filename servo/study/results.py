"""The results of a study: its units, cells with intervals, and paired comparisons.

A unit is what could have been otherwise, over which intervals are taken. Over several scenarios it
is the scenario; else the seed, which decides the draws in all cells. Seeds that draw nothing, so
that all runs of a cell are alike, are one observation.
"""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from servo.loop.measure import COUNTED, MEASURES, TIMED
from servo.scenario.expected import SUCCESS_RATE
from servo.study.plan import Study
from servo.study.run import SCENARIO, Row
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
"""Measures of a table in which nothing differs."""
MOST_MOVED = 5
LEAST_MOVED = 0.05
"""Least difference between cells, over the largest mean."""
ALIKE = 0.98
"""Correlation over the cells from which on a second measure says the same."""
COMPARED = ("first", "second", "unit", "wins", "losses", "ties", "z", "p", "p_holm")
_Held = dict[Any, dict[tuple[Any, ...], bool]]
"""Whether runs succeeded, by unit and by what else distinguishes them."""


@dataclass(frozen=True, slots=True)
class Units:
    """Rows of a study by their unit."""

    name: str
    """scenario, draw, seed, or run where all is one observation."""
    rows: dict[Any, list[Row]]

    @staticmethod
    def of(rows: Sequence[Row], keys: Collection[str], drawn: bool, apart: str = "") -> "Units":
        """Return the units of rows.

        Args:
            rows: Runs of one study.
            keys: Its axes.
            drawn: Whether its seeds draw settings.
            apart: An axis whose values are compared: where this is the scenario, scenarios are no
                units.
        """
        if apart != SCENARIO and len({row.get(SCENARIO) for row in rows}) > 1:
            return Units("scenario", _by(rows, [SCENARIO]))
        if drawn or _varies(rows, keys):
            return Units("draw" if drawn else "seed", _by(rows, ["seed"]))
        return Units("run", {(): list(rows)} if rows else {})

    def mean(self, name: str) -> Interval | None:
        """Return the mean over the units of a measure's mean in each; None if no run has it."""
        scores = [found.mean() for rows in self.rows.values() if len(found := values(rows, name))]
        if not scores:
            return None
        measure = RECORDED.get(name)
        if measure is not None and measure.share:
            return mean_percent(np.array(scores) / 100)
        least = -np.inf if measure is not None and measure.signed else 0.0
        return mean_of(np.array(scores), least=least, most=1.0 if name == SUCCESS else np.inf)


def values(rows: Iterable[Row], name: str) -> Array:
    """Return the finite values (n,) of a measure."""
    found = np.array([r[name] for r in rows if r.get(name) is not None], dtype=float)
    return found[np.isfinite(found)]


def uncounted(rows: Sequence[Row]) -> str:
    """Return a sentence where there are runs and none lasts until its errors count."""
    if not rows or any(len(values(rows, name)) for name in COUNTED):
        return ""
    return "No run reaches measure.after: what counts from there on has no value."


def _by(rows: Iterable[Row], keys: Sequence[str]) -> dict[Any, list[Row]]:
    found: dict[Any, list[Row]] = {}
    for row in rows:
        found.setdefault(tuple(row.get(key) for key in keys), []).append(row)
    return found


def _varies(rows: Sequence[Row], keys: Collection[str]) -> bool:
    """Return whether two seeds of a cell differ in anything but time."""
    cells = _by(rows, [SCENARIO, *keys]).values()
    return any(len(_by(cell, ["outcome", *UNTIMED])) > 1 for cell in cells)


@dataclass(frozen=True, slots=True)
class Cell:
    """The runs with one combination of axis values."""

    settings: dict[str, Any]
    runs: int
    unit: str
    """Kind of the units over which its intervals are."""
    success: Interval | None
    means: dict[str, Interval]
    """Means of the measures over the runs in which they are finite; others are left out."""
    finite: dict[str, int]
    """Number of those runs by measure."""

    @staticmethod
    def of(settings: dict[str, Any], rows: Sequence[Row], *, drawn: bool) -> "Cell":
        """Return the counts and means of runs (at least one) with the same values on all axes.

        Args:
            settings: These values by setting.
            rows: The runs.
            drawn: Whether each seed draws settings: intervals are then over seeds.
        """
        units = Units.of(rows, settings, drawn)
        found = {name: units.mean(name) for name in MEASURED}
        means = {name: mean for name, mean in found.items() if mean is not None}
        finite = {name: len(values(rows, name)) for name in MEASURED}
        return Cell(settings, len(rows), units.name, units.mean(SUCCESS), means, finite)


@dataclass(frozen=True, slots=True)
class Compared:
    """Two values of the compared axis, over units with runs that are otherwise the same."""

    first: Any
    second: Any
    unit: str
    test: McNemar
    """Counts units in which the first, the second, neither succeeded more often."""
    p_holm: float
    """The exact p value, corrected for the number of comparisons (Holm)."""

    @property
    def cells(self) -> list[Any]:
        """Its values, as `COMPARED` names them."""
        t = self.test
        return [self.first, self.second, self.unit, t.wins, t.losses, t.ties, t.z, t.p, self.p_holm]


def grouped(keys: Sequence[str], rows: Iterable[Row]) -> list[tuple[dict[str, Any], list[Row]]]:
    """Return the rows grouped by the values of axes, in the order of the rows."""
    groups = _by(rows, keys)
    return [(dict(zip(keys, at, strict=True)), group) for at, group in groups.items()]


def cells_of(study: Study, rows: Iterable[Row]) -> list[Cell]:
    """Return the cells that have runs, in the order of the study."""
    drawn = bool(study.draws)
    return [Cell.of(settings, group, drawn=drawn) for settings, group in grouped(study.keys, rows)]


def moved(cells: Sequence[Cell]) -> list[str]:
    """Return the measures that differ most between the cells, at most `MOST_MOVED`.

    A difference counts against the intervals of the means, and has to be a part of the largest
    mean. A measure that goes with an earlier one is left out, as a peak with its rms.
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
            other for other in scores if abs(np.corrcoef(values[name], values[other])[0, 1]) > ALIKE
        ]
        first = alike[0] if alike else name
        scores[first] = max(score, scores.get(first, 0.0))
    chosen = sorted(scores, key=lambda name: -scores[name])[:MOST_MOVED]
    return [name for name in MEASURED if name in (chosen or SHOWN)]


def comparisons(
    key: str | None, axes: Sequence[str], rows: Sequence[Row], *, drawn: bool = False
) -> list[Compared]:
    """McNemar's test on success for every pair of values of the axis `key`, with Holm's correction.

    The two are compared in each unit, over the runs that are otherwise the same in both: same
    scenario, seed, and other axes. `drawn`: whether the seeds draw settings.
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
    """Return the cells as CSV.

    Columns are the axes, runs, unit, success rate and means with 95 % intervals, and the number of
    runs in which each measure is finite.
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
    """Return the mean over the units of the share of successes in each."""
    return float(np.mean([np.mean(list(unit.values())) for unit in held.values()]))


def _mcnemar(first: _Held, second: _Held) -> McNemar:
    rates: list[tuple[float, float]] = []
    for unit in first.keys() & second.keys():
        both = first[unit].keys() & second[unit].keys()
        if both:
            pair = [float(np.mean([held[unit][at] for at in both])) for held in (first, second)]
            rates.append((pair[0], pair[1]))
    return McNemar.of(*np.array(rates, float).reshape(-1, 2).T)
