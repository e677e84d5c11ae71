"""Figures of a study: errors over time, share of runs whose tracker is still on the target over
time, errors and success rates against the axes, and heat maps over two axes.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from servo.loop.measure import MEASURES
from servo.report import charts
from servo.report.charts import ERROR_RANGE, SETTING_RANGE, Curve, Scale, colour, curves
from servo.report.page import LIGHT, Figure
from servo.report.study_data import (
    MOST_OVER_TIME,
    SUCCESS,
    TIME,
    RunRow,
    Series,
    StudyResults,
    duration,
    has_value,
    median,
)
from servo.report.words import cut, listed, shown
from servo.study.results import grouped
from servo.study.run import SCENARIO
from sim.types import Array

TIMES = 200
"""Points in time of a curve."""
BAND = (50, 10, 90)
"""Percentiles of the line, and of the lower and the upper edge of a band."""
ROUNDING = 1e-3
"""Largest difference of two ends that count as equal [s]: times are stored with seven digits."""
SETTLED = 1.0
"""Time from the start in which a loss does not count [s]."""
ERROR = "servo_rms_px"
APART = (SCENARIO, "run.duration")
"""Axes over which curves over time are not comparable: each value has figures of its own."""
MOST_APART = 6
MOST_AXES = 6
MOST_CELLS = 20
MOST_SERIES = len(LIGHT)
COLOURED = 8.0
"""Errors that differ by more than this factor are coloured on a logarithmic scale."""
AVERAGED = "Mean over all else, with its 95 % interval over"
ON_TARGET = "on_target"
NEVER_OFF = (
    "Runs whose estimate was never off the target after the first second: this is the tracker's "
    "error, not the camera's."
)
Values = tuple[Array, ...]
"""Times (n,) [s] and values (n,), with the edges of a band (n,) if there is one."""
DISTANCES = {
    "servo_error_px": "Distance from the goal",
    "tracking_error_px": "Error of the tracker",
}


def figures(study: StudyResults) -> list[Figure]:
    """Return figures over time: of the errors [px], and of the share of runs whose tracker is still
    on the target. Each value of the axis that the study compares has a colour.

    Each scenario and each duration (`run.duration`) of the study has figures of its own, at most
    the first six combinations of them, unless it is what the study compares.
    """
    keys = [key for key in APART if key in study.axes and key != study.compared]
    parts = grouped(keys, study.rows)
    note = ""
    if len(study.series) == MOST_OVER_TIME:
        drawn_runs = "those of the first seed, and others drawn at random"
        note = f"Of {MOST_OVER_TIME:,} runs: {drawn_runs}."
    note = f"{note} {cut(' and '.join(keys), parts, MOST_APART) or ''}".strip()
    found: list[Figure] = []
    for settings, rows in parts[:MOST_APART]:
        where = f": {listed(settings)}" if settings else ""
        found += _over_time(replace(study, rows=rows), where, note)
    return found


def _over_time(study: StudyResults, where: str, note: str) -> list[Figure]:
    groups = {
        name: [s for row in rows if (s := study.series.get(row["run"])) is not None]
        for name, rows in study.groups(study.compared).items()
    }
    found = {name: series for name, series in groups.items() if series}
    shown = dict(list(found.items())[:MOST_SERIES])
    note = f"{note} {cut(f'values of {study.compared}', list(found), MOST_SERIES) or ''}".strip()
    distance = Scale("distance [px]", low=0, log_from=ERROR_RANGE)
    asked: list[tuple[str, Scale, Callable[[Sequence[Series]], Values | None], str]] = [
        *(
            (title, distance, partial(band, name=name), "Median and 10 to 90 % of the runs.")
            for name, title in DISTANCES.items()
        ),
        ("Still on target", Scale("share of runs", 0, 1.02), survival, NEVER_OFF),
    ]
    drawn = ((title, scale, _lines(shown, of), about) for title, scale, of, about in asked)
    return [
        curves(title + where, Scale("time [s]"), scale, lines, note=f"{about} {note}")
        for title, scale, lines, about in drawn
        if lines
    ]


def _lines(
    groups: Mapping[str, Sequence[Series]], of: Callable[[Sequence[Series]], Values | None]
) -> list[Curve]:
    """Return a curve for each group of runs that has values."""
    found = [(label, of(series)) for label, series in groups.items()]
    return [
        Curve(label, *values, colour=colour(i))
        for i, (label, values) in enumerate(found)
        if values is not None
    ]


def band(runs: Sequence[Series], name: str) -> Values | None:
    """Return 200 times (n,) [s], and the median, 10th and 90th percentile (n,) of a value at these
    times, over the runs that last until then; None if no run has finite values of it.

    Args:
        runs: Values of each run over time (m,) by name; "time_s" are the times [s].
        name: Name of the value, such as "servo_error_px".
    """
    having = [run for run in runs if name in run and np.isfinite(run[name]).any()]
    if not having:
        return None
    times, lasting = _lasting(having)
    known = [np.isfinite(run[name]) for run in having]
    every = np.stack(
        [
            np.interp(times, run[TIME][at], run[name][at])
            for run, at in zip(having, known, strict=True)
        ]
    )
    middle, low, high = np.nanpercentile(np.where(lasting, every, np.nan), BAND, axis=0)
    return times, middle, low, high


def survival(runs: Sequence[Series]) -> Values | None:
    """Return 200 times (n,) [s], and at each the share (n,), from 0 to 1, of the runs whose tracker
    was never off the target between 1 s and then, among the runs that last until then; None if no
    run has the value "on_target".

    Args:
        runs: Values of each run over time (m,) by name; "time_s" are the times [s].
    """
    having = [run for run in runs if ON_TARGET in run]
    if not having:
        return None
    times, lasting = _lasting(having)
    off = [run[TIME][(run[TIME] >= SETTLED) & ~(run[ON_TARGET] > 0)] for run in having]
    lost = np.array([after[0] if len(after) else np.inf for after in off])
    return times, (lasting & (lost[:, None] > times)).sum(axis=0) / lasting.sum(axis=0)


def _lasting(runs: Sequence[Series]) -> tuple[Array, NDArray[np.bool_]]:
    """Return times (n,) [s] until the end of the longest run, and flags (runs, n): whether a run
    lasts until a time.
    """
    ends = np.array([duration(run) for run in runs])
    times = np.linspace(0, ends.max(), TIMES)
    return times, ends[:, None] + ROUNDING >= times


def against(study: StudyResults) -> list[Figure]:
    """Return figures of the mean rms error [px] and of the success rate (0 to 1), with 95 %
    intervals, against each numeric axis of a study, the first six at most. Each value of the axis
    that the study compares has a colour.
    """
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
                over = study.units(study.rows)
                said = f"{AVERAGED} {len(over.rows)} {over.name}s. {note}"
                found.append(_against(key, name, drawn, said))
    return found


def heat_maps(study: StudyResults) -> list[Figure]:
    """Return heat maps of the success rate (0 to 1) and, if a run has a finite one, the median rms
    error [px] over two axes of a study; an empty list if the study has fewer axes. Numeric axes are
    preferred, then the axis that the study compares. Each axis has at most its first 20 values.
    """
    keys = sorted(study.axes, key=lambda k: (not _numeric(study.axes[k]), k != study.compared))
    if len(keys) < 2:
        return []
    x = keys[0]
    y = keys[1]
    columns = study.axes[x][:MOST_CELLS]
    rows = study.axes[y][:MOST_CELLS]
    notes = ["All else is averaged."] if len(keys) > 2 else []
    notes += [cut(f"values of {k}", study.axes[k], MOST_CELLS) or "" for k in (x, y)]
    note = " ".join(filter(None, notes))

    def grid(score: Callable[[list[RunRow]], float]) -> Array:
        return np.array(
            [
                [
                    score([r for r in study.rows if has_value(r, x, a) and has_value(r, y, b)])
                    for a in columns
                ]
                for b in rows
            ],
            float,
        )

    named = [shown(v) for v in columns], [shown(v) for v in rows]
    rate = grid(lambda cell: float(np.mean([r[SUCCESS] for r in cell])) if cell else np.nan)
    error = grid(lambda cell: median(cell, ERROR))
    drawn = [charts.heat("Success rate", x, y, *named, rate, limits=(0, 1), note=note)]
    if np.isfinite(error).any():
        title = f"Median error, {ERROR}"
        drawn.append(charts.heat(title, x, y, *named, error, log_from=COLOURED, note=note))
    return drawn


def _curve(
    study: StudyResults, rows: list[RunRow], key: str, name: str, label: str, ink: str
) -> Curve:
    at: list[tuple[float, float, float, float]] = []
    for value in sorted(study.axes[key]):
        found = study.units([r for r in rows if r[key] == value]).mean(name)
        if found is not None:
            at.append((float(value), found.value, found.low, found.high))
    x, y, low, high = np.array(at).reshape(-1, 4).T
    return Curve(label, x, y, low, high, ink, points=True)


def _against(key: str, name: str, drawn: list[Curve], note: str) -> Figure:
    across = Scale(key, log_from=SETTING_RANGE)
    if name == SUCCESS:
        return charts.curves(
            f"Success against {key}", across, Scale("success rate", -0.02, 1.02), drawn, note=note
        )
    measure = MEASURES[name]
    along = Scale(f"error [{measure.unit}]", low=0, log_from=ERROR_RANGE)
    title = f"Error against {key}: {measure.meaning}"
    return charts.curves(title, across, along, drawn, note=note)


def _numeric(values: list[object]) -> bool:
    return all(isinstance(v, int | float) and not isinstance(v, bool) for v in values)
