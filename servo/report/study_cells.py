"""The cells of a study, runs alike in all but seed and draws, and the bounds that each keeps."""

from __future__ import annotations

from typing import Any

import numpy as np

from servo.report.study_data import SUCCESS, Row, Study, values
from servo.report.words import listed

RATE = "success_rate"
"""The bound that is a least one; all others are most."""


def cells(study: Study) -> list[tuple[dict[str, Any], list[Row]]]:
    """Axis values and runs of each cell that has runs, in the order of the runs."""
    groups: dict[tuple[Any, ...], list[Row]] = {}
    for row in study.rows:
        groups.setdefault(tuple(row[key] for key in study.axes), []).append(row)
    return [(dict(zip(study.axes, at, strict=True)), rows) for at, rows in groups.items()]


def missed(study: Study) -> list[str]:
    """A sentence for each bound that a cell does not keep."""
    told: list[str] = []
    for settings, rows in cells(study):
        for name, bound in study.plan.expect.items():
            at_least = name == RATE
            found = _mean(rows, SUCCESS if at_least else name)
            if not (found >= bound if at_least else found <= bound):
                words = "at least" if at_least else "at most"
                where = listed(settings) or "all runs"
                told.append(f"{where}: {name} is {found:.3g}, expected {words} {bound:g}")
    return told


def _mean(rows: list[Row], name: str) -> float:
    """Over the runs that have it; infinite where none has."""
    found = values(rows, name)
    return float(np.mean(found)) if len(found) else np.inf
