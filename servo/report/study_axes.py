"""Figures of a study's errors against each numeric axis, and over two axes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from servo.loop.run_measures import MEANINGS
from servo.report import charts
from servo.report.charts import ERRORS, SETTINGS, Curve, Scale
from servo.report.drawing import LIGHT, colour
from servo.report.page import Figure
from servo.report.study_data import SUCCESS, Row, StudyResults, interval, median, same
from servo.report.words import cut, shown

ERROR = "servo_rms_px"
MOST_AXES, MOST_CELLS, MOST_SERIES = 6, 20, len(LIGHT)
COLOURED = 8.0
"""Errors that differ by more than this factor are coloured on a logarithmic scale."""
AVERAGED = "Mean over all else, with its 95 % interval."


def against(study: StudyResults) -> list[Figure]:
    """Error and success rate against each numeric axis, with a colour for each compared value."""
    numeric = [key for key in study.axes if _numeric(study.axes[key])]
    found: list[Figure] = []
    for key in numeric[:MOST_AXES]:
        other = study.compared if study.compared != key else None
        groups = study.groups(other)
        note = cut(f"values of {other}", list(groups), MOST_SERIES) or ""
        for name in (ERROR, SUCCESS):
            drawn = [
                _curve(study, rows, key, name, label, colour(i))
                for i, (label, rows) in enumerate(list(groups.items())[:MOST_SERIES])
            ]
            drawn = [curve for curve in drawn if len(curve.x)]
            if drawn:
                found.append(_against(key, name, drawn, f"{AVERAGED} {note}"))
    return found


def heat_maps(study: StudyResults) -> list[Figure]:
    """Success rate and median error over two axes: numeric ones first, then the compared one."""
    keys = sorted(study.axes, key=lambda k: (not _numeric(study.axes[k]), k != study.compared))
    if len(keys) < 2:
        return []
    x, y = keys[0], keys[1]
    columns, rows = study.axes[x][:MOST_CELLS], study.axes[y][:MOST_CELLS]
    notes = ["All else is averaged."] if len(keys) > 2 else []
    notes += [cut(f"values of {k}", study.axes[k], MOST_CELLS) or "" for k in (x, y)]
    note = " ".join(filter(None, notes))

    def grid(score: Callable[[list[Row]], float]) -> Any:
        return np.array([
            [score([r for r in study.rows if same(r[x], a) and same(r[y], b)]) for a in columns]
            for b in rows
        ], float)  # fmt: skip

    named = [shown(v) for v in columns], [shown(v) for v in rows]
    rate = grid(lambda cell: float(np.mean([r[SUCCESS] for r in cell])) if cell else np.nan)
    error = grid(lambda cell: median(cell, ERROR))
    drawn = [charts.heat("Success rate", x, y, *named, rate, limits=(0, 1), note=note)]
    if np.isfinite(error).any():
        title = f"Median error, {ERROR}"
        drawn.append(charts.heat(title, x, y, *named, error, log_from=COLOURED, note=note))
    return drawn


def _curve(
    study: StudyResults, rows: list[Row], key: str, name: str, label: str, ink: str
) -> Curve:
    at: list[tuple[float, float, float, float]] = []
    for value in sorted(study.axes[key]):
        found = interval([r for r in rows if same(r[key], value)], name)
        if found is not None:
            at.append((float(value), found.value, found.low, found.high))
    x, y, low, high = np.array(at).reshape(-1, 4).T
    return Curve(label, x, y, low, high, ink, points=True)


def _against(key: str, name: str, drawn: list[Curve], note: str) -> Figure:
    across = Scale(key, log_from=SETTINGS)
    if name == SUCCESS:
        return charts.curves(f"Success against {key}", across, Scale("success rate", -0.02, 1.02),
                             drawn, note=note)  # fmt: skip
    unit, meaning = MEANINGS[name]
    along = Scale(f"error [{unit}]", low=0, log_from=ERRORS)
    return charts.curves(f"Error against {key}: {meaning}", across, along, drawn, note=note)


def _numeric(values: list[Any]) -> bool:
    return all(isinstance(v, int | float) and not isinstance(v, bool) for v in values)
