"""Figures of a study over time: median errors with bands, and the share still on target."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from servo.report.charts import ERRORS, Curve, Scale, curves
from servo.report.drawing import LIGHT, colour
from servo.report.page import Figure
from servo.report.study_data import Series, StudyResults
from servo.report.words import cut
from sim.types import Array

TIMES = 200
"""Points in time of a curve."""
BAND = (10, 50, 90)
"""Percentiles of the lower edge, the line and the upper edge of a band."""
ROUNDING = 1e-3
"""Largest difference of two ends that count as equal [s]: times are stored with seven digits."""
SETTLED = 1.0
"""Time from the start in which a loss does not count [s]."""
MOST = len(LIGHT)
DISTANCES = {
    "servo_error_px": "Distance from the goal",
    "tracking_error_px": "Error of the tracker",
}


def figures(study: StudyResults) -> list[Figure]:
    """Errors and survival over time, with a colour for each value of the compared axis."""
    groups = {
        name: [s for row in rows if (s := study.series.get(row["run"])) is not None]
        for name, rows in study.groups(study.compared).items()
    }
    found = {name: series for name, series in groups.items() if series}
    shown = dict(list(found.items())[:MOST])
    note = cut(f"values of {study.compared}", list(found), MOST) or ""
    drawn = [_errors(shown, name, title, note) for name, title in DISTANCES.items()]
    return [figure for figure in (*drawn, _survival(shown, note)) if figure is not None]


def band(series: Sequence[Series], name: str) -> tuple[Array, Array] | None:
    """Times (n,) [s], and percentiles (3, n) over the runs that last until each time."""
    having = [(s, np.isfinite(s.values[name])) for s in series if name in s.values]
    having = [(s, finite) for s, finite in having if finite.any()]
    if not having:
        return None
    times = np.linspace(0, max(s.duration for s, _ in having), TIMES)
    every = np.stack(
        [np.interp(times, s.time[known], s.values[name][known]) for s, known in having]
    )
    ended = times > ROUNDING + np.array([s.duration for s, _ in having])[:, None]
    return times, np.nanpercentile(np.where(ended, np.nan, every), BAND, axis=0)


def survival(series: Sequence[Series]) -> tuple[Array, Array] | None:
    """Times (n,) [s], and the share (n,) on target so far of the runs that last until each time."""
    having = [s for s in series if "on_target" in s.values]
    if not having:
        return None
    durations = np.array([s.duration for s in having])
    lost = np.array([_first_loss(s.time, s.values["on_target"] > 0) for s in having])
    times = np.linspace(0, durations.max(), TIMES)
    lasting = durations[:, None] + ROUNDING >= times
    return times, (lasting & (lost[:, None] > times)).sum(axis=0) / lasting.sum(axis=0)


def _first_loss(time: Array, on_target: NDArray[np.bool_]) -> float:
    off = (time >= SETTLED) & ~on_target
    return float(time[np.argmax(off)]) if off.any() else np.inf


def _errors(groups: dict[str, list[Series]], name: str, title: str, note: str) -> Figure | None:
    drawn: list[Curve] = []
    for i, (label, series) in enumerate(groups.items()):
        found = band(series, name)
        if found is not None:
            times, (low, middle, high) = found
            drawn.append(Curve(label, times, middle, low, high, colour(i)))
    if not drawn:
        return None
    distance = Scale("distance [px]", low=0, log_from=ERRORS)
    note = f"Median and 10 to 90 % of the runs. {note}"
    return curves(title, Scale("time [s]"), distance, drawn, note=note)


def _survival(groups: dict[str, list[Series]], note: str) -> Figure | None:
    found = {label: survival(series) for label, series in groups.items()}
    drawn = [Curve(label, *curve, colour=colour(i))
             for i, (label, curve) in enumerate(found.items()) if curve is not None]  # fmt: skip
    if not drawn:
        return None
    share = Scale("share of runs", 0, 1.02)
    note = f"Runs that were never off the target after the first second. {note}"
    return curves("Still on target", Scale("time [s]"), share, drawn, note=note)
