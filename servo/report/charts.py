"""The figures of a page: curves, values by name, and heat maps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from numpy.typing import NDArray

from servo.report.drawing import INK, canvas, colour, css, svg
from servo.report.page import Figure, Key
from servo.report.words import shown
from sim.types import Array
from tracking.statistics.comparisons import Interval

ERRORS = 50.0
SETTINGS = 10.0
"""Errors and settings that differ by more than this factor are drawn on a logarithmic axis."""
DEEPEST = 1e3
"""Largest ratio of the ends of a logarithmic axis."""
ROOM = 1.15
ROW = 0.24
FRAME = 0.7
"""Height of a row of names, and of the figure without rows [inch]."""
MOST_IN_CELLS = 10
"""Most columns of a heat map with numbers in its cells."""
MAP = "viridis"
DARK_BELOW = 0.6
BAND = 0.18

Shade = tuple[Array, NDArray[np.bool_]]
"""Times (n,), and flags (n,): where they are true, a figure is shaded."""


@dataclass(frozen=True, slots=True)
class Curve:
    """A line with an optional band of intervals."""

    label: str
    x: Array
    y: Array
    low: Array | None = None
    high: Array | None = None
    colour: str = INK
    dashed: bool = False
    points: bool = False
    """Whether it is drawn as points with error bars."""


@dataclass(frozen=True, slots=True)
class Scale:
    """Title, limits and scale of an axis."""

    title: str
    low: float | None = None
    high: float | None = None
    log_from: float | None = None
    """Ratio of the values above which the axis is logarithmic; None: never."""


def curves(
    title: str,
    x: Scale,
    y: Scale,
    drawn: Sequence[Curve],
    *,
    shaded: Shade | None = None,
    note: str = "",
) -> Figure:
    """A figure of lines over a common axis, shaded where the flags are true."""
    with canvas() as (figure, axes):
        for curve in drawn:
            _draw(axes, curve)
        if shaded is not None:
            across = axes.get_xaxis_transform()
            where = shaded[1].tolist()
            axes.fill_between(
                shaded[0], 0, 1, where=where, transform=across, color=INK, alpha=0.1, lw=0
            )
        axes.set(xlabel=x.title, ylabel=y.title)
        _scale(axes, x, [c.x for c in drawn], "x")
        _scale(axes, y, [v for c in drawn for v in (c.y, c.low, c.high) if v is not None], "y")
        if any(c.points for c in drawn):
            axes.margins(x=0.05)
        keys = [Key(c.label, css(c.colour), c.dashed) for c in drawn if len(drawn) > 1 or c.dashed]
        return Figure(title, svg(figure, title), keys, note)


def by_name(
    title: str,
    across: str,
    names: Sequence[str],
    groups: Mapping[str, Sequence[Interval | None]],
    *,
    note: str = "",
) -> Figure:
    """A figure of values with intervals: a row for each name, a colour for each group."""
    with canvas(FRAME + ROW * max(2, len(names)) * max(1, 0.6 * len(groups))) as (figure, axes):
        step = 0.6 / max(1, len(groups))
        for i, (label, values) in enumerate(groups.items()):
            for row, value in enumerate(values):
                if value is not None:
                    at = row + (i - (len(groups) - 1) / 2) * step
                    ends = (value.low, value.high) if value.known else (value.value, value.value)
                    bars = [[max(value.value - ends[0], 0)], [max(ends[1] - value.value, 0)]]
                    axes.errorbar(
                        [value.value],
                        [at],
                        xerr=bars,
                        fmt="o",
                        ms=4,
                        lw=1.4,
                        color=colour(i),
                        label=label,
                    )
        axes.set_yticks(range(len(names)), names)
        axes.invert_yaxis()
        axes.margins(x=0.05, y=0.5 / max(1, len(names)))
        axes.set_xlabel(across)
        found = [np.array([v.value, v.low]) for vs in groups.values() for v in vs if v is not None]
        _scale(axes, Scale(across, low=0, log_from=ERRORS), found, "x")
        keys = [Key(label, css(colour(i))) for i, label in enumerate(groups) if len(groups) > 1]
        return Figure(title, svg(figure, title), keys, note)


def heat(
    title: str,
    x: str,
    y: str,
    columns: Sequence[str],
    rows: Sequence[str],
    values: Array,
    *,
    limits: tuple[float, float] | None = None,
    log_from: float = np.inf,
    note: str = "",
) -> Figure:
    """A figure of values (rows, columns) as colours; a cell that is nan stays empty."""
    finite = values[np.isfinite(values)]
    scaled: Array = np.log(values) if finite.min() > 0 and _range(finite) > log_from else values
    known = scaled[np.isfinite(scaled)]
    low, high = limits or (float(known.min()), float(known.max()))
    shares = (scaled - low) / max(high - low, 1e-12)
    with canvas(FRAME + max(0.3, min(0.5, 3.0 / len(rows))) * max(3, len(rows))) as (figure, axes):
        axes.grid(visible=False)
        for (row, column), value in np.ndenumerate(values):
            if np.isfinite(value):
                said = shown(float(value)) if len(columns) <= MOST_IN_CELLS else ""
                _tile(axes, row, column, said, float(shares[row, column]))
        turned = sum(map(len, columns)) > 45
        axes.set_xticks(range(len(columns)), columns, rotation=60 if turned else 0)
        axes.set_yticks(range(len(rows)), rows)
        axes.tick_params(length=0)
        axes.spines[:].set_visible(False)
        axes.set(xlim=(-0.5, len(columns) - 0.5), ylim=(-0.5, len(rows) - 0.5))
        axes.set(xlabel=x, ylabel=y)
        return Figure(title, svg(figure, title), note=note)


def _draw(axes: Axes, curve: Curve) -> None:
    if curve.points and curve.low is not None and curve.high is not None:
        bars = np.maximum([curve.y - curve.low, curve.high - curve.y], 0)
        axes.errorbar(
            curve.x, curve.y, yerr=bars, fmt="o-", ms=3.5, lw=1.4, capsize=2, color=curve.colour
        )
        return
    if curve.low is not None and curve.high is not None:
        axes.fill_between(curve.x, curve.low, curve.high, color=curve.colour, alpha=BAND, lw=0)
    dashes, width = ("--", 1.0) if curve.dashed else ("-", 1.5)
    axes.plot(curve.x, curve.y, dashes, color=curve.colour, lw=width)


def _scale(axes: Axes, axis: Scale, values: Sequence[Array], which: str) -> None:
    """Set the limits of an axis, and a logarithmic scale where the values need it."""
    every = np.concatenate([np.zeros(0), *values])
    above = every[np.isfinite(every) & (every > 0)]
    limits = axes.set_xlim if which == "x" else axes.set_ylim
    if axis.log_from is not None and len(above) and _range(above) > axis.log_from:
        (axes.set_xscale if which == "x" else axes.set_yscale)("log")
        limits(max(above.min(), above.max() / DEEPEST) / ROOM, above.max() * ROOM)
        shaft = axes.xaxis if which == "x" else axes.yaxis
        if above.max() / above.min() < DEEPEST / ROOM:
            shaft.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        shaft.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        shaft.set_minor_formatter(NullFormatter())
    elif axis.low is not None or axis.high is not None:
        limits(axis.low, axis.high)


def _range(values: Array) -> float:
    """Largest value over the lower quartile, so that a few values near zero do not count."""
    return float(values.max() / np.percentile(values, 25))


def _tile(axes: Axes, row: int, column: int, said: str, share: float) -> None:
    share = min(max(share, 0.0), 1.0)
    face = colormaps[MAP](share)
    axes.add_patch(Rectangle((column - 0.48, row - 0.47), 0.96, 0.94, facecolor=face, lw=0))
    ink = "white" if share < DARK_BELOW else "black"
    axes.text(column, row, said, ha="center", va="center", fontsize=8, color=ink)
