"""The units of a study: what could have been otherwise, over which its intervals are taken.

Over several scenarios the unit is the scenario; else the seed, which decides the draws in all
cells. Seeds that draw nothing, so that all runs of a cell are alike, are one observation.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from servo.loop.run_measures import MEANINGS
from servo.study.axes import SCENARIO
from servo.study.scenario_run import TIMES
from sim.types import Array
from tracking.statistics.comparisons import Interval, mean_of

Row = dict[str, Any]
SUCCESS = "success"
SIGNED = ("detour_m",)
"""Measures that may be below 0."""
UNTIMED = tuple(name for name in MEANINGS if name not in TIMES)


@dataclass(frozen=True, slots=True)
class Units:
    """Rows of a study by their unit."""

    name: str
    """scenario, draw, seed, or run where all is one observation."""
    rows: dict[Any, list[Row]]

    @staticmethod
    def of(rows: Sequence[Row], keys: Collection[str], drawn: bool, apart: str = "") -> Units:
        """The units of rows.

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
        """Mean over the units of a measure's mean in each; None if no run has it."""
        scores = [found.mean() for rows in self.rows.values() if len(found := values(rows, name))]
        if not scores:
            return None
        least = -np.inf if name in SIGNED else 0.0
        most = 1.0 if name == SUCCESS else np.inf
        return mean_of(np.array(scores), least=least, most=most)


def values(rows: Iterable[Row], name: str) -> Array:
    """The finite values of a measure (n,)."""
    found = np.array([r[name] for r in rows if r.get(name) is not None], dtype=float)
    return found[np.isfinite(found)]


def _by(rows: Sequence[Row], keys: Iterable[str]) -> dict[Any, list[Row]]:
    found: dict[Any, list[Row]] = {}
    for row in rows:
        found.setdefault(tuple(row.get(key) for key in keys), []).append(row)
    return found


def _varies(rows: Sequence[Row], keys: Collection[str]) -> bool:
    """Whether two seeds of a cell differ in anything but time."""
    cells = _by(rows, [SCENARIO, *keys]).values()
    return any(len(_by(cell, ["outcome", *UNTIMED])) > 1 for cell in cells)
