"""The results of a study: cells with intervals, paired comparisons, and missed bounds."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from servo.study.bounds import SUCCESS_RATE
from servo.study.plan import Study
from servo.study.record import Row
from servo.study.scenario_run import MEASURED
from servo.study.units import Units
from tracking.files.csv_text import csv_text
from tracking.statistics.comparisons import Interval, McNemar, cells, holm, titles

COMPARED = ("first", "second", "unit", "wins", "losses", "ties", "z", "p", "p_holm")
_Held = dict[Any, dict[tuple[Any, ...], bool]]
"""Whether runs succeeded, by unit and by what else distinguishes them."""


@dataclass(frozen=True, slots=True)
class Cell:
    """The runs with one combination of axis values."""

    settings: dict[str, Any]
    runs: int
    unit: str
    """What its intervals are over."""
    success: Interval | None
    means: dict[str, Interval]
    """Means of the measures over the runs in which they are finite; others are left out."""

    @staticmethod
    def of(settings: dict[str, Any], rows: Sequence[Row], *, drawn: bool) -> Cell:
        """The cell of some rows, at least one; `drawn`: whether the seeds draw settings."""
        units = Units.of(rows, settings, drawn)
        found = {name: units.mean(name) for name in MEASURED}
        means = {name: mean for name, mean in found.items() if mean is not None}
        return Cell(settings, len(rows), units.name, units.mean("success"), means)


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
    """The rows grouped by the values of axes; each group with its values, in the rows' order."""
    groups: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        groups.setdefault(tuple(row[k] for k in keys), []).append(row)
    return [(dict(zip(keys, at, strict=True)), group) for at, group in groups.items()]


def cells_of(study: Study, rows: Iterable[Row]) -> list[Cell]:
    """The cells that have runs, in the order of the study."""
    keys = [axis.key for axis in study.every_axis]
    drawn = bool(study.draws)
    return [Cell.of(settings, group, drawn=drawn) for settings, group in grouped(keys, rows)]


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
    pairs = [(a, b) for i, a in enumerate(names) for b in names[i + 1 :]]
    tests = [_mcnemar(held[a], held[b]) for a, b in pairs]
    corrected = holm(np.array([t.p for t in tests])) if tests else []
    return [
        Compared(a, b, units.name, test, float(p))
        for (a, b), test, p in zip(pairs, tests, corrected, strict=True)
    ]


def cells_csv(study: Study, found: Sequence[Cell]) -> str:
    """The cells as CSV: axes, runs, unit, and success rate and means with 95 % intervals."""
    keys = [axis.key for axis in study.every_axis]
    lines = [
        [
            *(cell.settings[k] for k in keys),
            cell.runs,
            cell.unit,
            *cells([cell.success, *map(cell.means.get, MEASURED)]),
        ]
        for cell in found
    ]
    return csv_text([*keys, "runs", "unit", *titles([SUCCESS_RATE, *MEASURED])], lines)


def _rate(held: _Held) -> float:
    """Mean over the units of the share of successes in each."""
    return float(np.mean([np.mean(list(unit.values())) for unit in held.values()]))


def _mcnemar(first: _Held, second: _Held) -> McNemar:
    rates: list[tuple[float, float]] = []
    for unit in first.keys() & second.keys():
        both = first[unit].keys() & second[unit].keys()
        if both:
            pair = [float(np.mean([held[unit][at] for at in both])) for held in (first, second)]
            rates.append((pair[0], pair[1]))
    return McNemar.of(*np.array(rates, float).reshape(-1, 2).T)
