"""Summaries of the runs that test a claim: means, differences and ratios with 95 % intervals, and
figures.
"""

from collections.abc import Mapping, Sequence
from itertools import cycle
from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from servo.study.run import Record
from sim.types import Array
from tracking.drawing import figures
from tracking.statistics.comparisons import (
    Interval,
    difference_of_shares,
    in_percent,
    mean_of,
    mean_percent,
)

COLOURS = ("#c23b2e", "#2b6cb0", "#1f7a3a", "#b7791f", "#6b46c1", "#4b5563", "#0e7490")
ROW_HEIGHT = 0.32
"""Height of a row of an interval [inch]."""
Logarithmic = Literal["x", "y"] | None


def group(records: Sequence[Record], **settings: object) -> list[Record]:
    """Return the records of runs whose settings have all the given values, such as
    tracker="kams-published", in their order.
    """
    return [r for r in records if all(r.settings[k] == value for k, value in settings.items())]


def column(records: Sequence[Record], measure: str) -> Array:
    """Return the value of a measure in each record (n,), in the measure's unit; nan or inf where a
    record has no value.
    """
    return np.array([r.measures[measure] for r in records])


def done(records: Sequence[Record]) -> str:
    """Return a text such as "3 of 4": the number of runs in which the target was never lost, and
    the number of all runs.
    """
    return f"{int(column(records, 'completed').sum())} of {len(records)}"


def reads(records: Sequence[Record]) -> str:
    """Return the mean number of histograms that a tracker computes in each frame, over records of
    runs, as a text without decimals.
    """
    return f"{column(records, 'evaluations').mean():.0f}"


def difference(first: Sequence[Record], second: Sequence[Record], measure: str) -> Interval:
    """Return the mean of the differences of a measure between paired runs, `first` minus `second`,
    with its 95 % interval, in the measure's unit. The i-th records of both lists are a pair.
    """
    return mean_of(column(first, measure) - column(second, measure))


def completed(records: Sequence[Record]) -> Interval:
    """Return the share [%] of runs (a tracker on a sequence) in which the target was never lost,
    with its 95 % interval.
    """
    return mean_percent(column(records, "completed"))


def completed_more(first: Sequence[Record], second: Sequence[Record]) -> Interval:
    """Return the difference of the shares of runs in which the target was never lost, `first` minus
    `second` [%], with its 95 % interval. The i-th records of both lists are of the same sequence.
    """
    return in_percent(difference_of_shares(column(first, "completed"), column(second, "completed")))


def ratio(first: Array, second: Array) -> Interval:
    """Return the geometric mean of the ratios of paired positive values (n,), `first` over
    `second`, with its 95 % interval.
    """
    log = mean_of(np.log(first / second))
    return Interval(*np.exp([log.value, log.low, log.high]).tolist())


def words(interval: Interval, unit: str = "") -> str:
    """Return a value and its 95 % interval as text, with three significant digits: "2.1 px (1.9 to
    2.4)", or only the value, "2.1 px", if the interval is unknown.
    """
    value = f"{interval.value:.3g} {unit}".rstrip()
    if not interval.known:
        return value
    return f"{value} ({interval.low:.3g} to {interval.high:.3g})"


def mean(records: Sequence[Record], measure: str, unit: str = "") -> str:
    """Return the mean of a measure over records, with its 95 % interval if it is known, as text
    such as "2.1 px (1.9 to 2.4)".

    Args:
        records: Records of runs.
        measure: Name of the measure.
        unit: Unit of the measure, which is printed after the mean.
    """
    return words(mean_of(column(records, measure)), unit)


def panels(rows: int, columns: int = 1, width: float = 7.0) -> tuple[Figure, list[Axes]]:
    """Return a Matplotlib figure, `width` inches wide, and its rows * columns axes, row by row from
    the top.
    """
    return figures.panels(width, 0.8 + 2.3 * rows, rows, columns)


def lines(
    title: str,
    x: str,
    y: str,
    curves: Mapping[str, tuple[ArrayLike, ArrayLike]],
    *,
    top: float | None = None,
    marker: str = "",
    logarithmic: Logarithmic = None,
) -> Figure:
    """Return a figure with curves drawn as lines.

    Args:
        title: Title of the figure.
        x: Label of the x axis.
        y: Label of the y axis.
        curves: x and y values of each curve, by label.
        top: Upper end of the y axis, which then begins at 0; None: automatic.
        marker: Marker of the points, as in Matplotlib.
        logarithmic: Axis with a logarithmic scale, "x" or "y"; None: neither.
    """
    figure, (axes,) = panels(1)
    for (label, curve), colour in zip(curves.items(), cycle(COLOURS), strict=False):
        axes.plot(*curve, color=colour, lw=1.2, marker=marker, label=label)
    axes.set(title=title, xlabel=x, ylabel=y)
    if top is not None:
        axes.set_ylim(0, top)
    _scale(axes, logarithmic)
    axes.legend(frameon=False, ncols=2, fontsize=8)
    return figure


def dots(
    title: str, y: str, groups: Mapping[str, Array], logarithmic: Logarithmic = None
) -> Figure:
    """Return a figure with one column of dots for each group of values (n,), one value for each
    sequence.

    Args:
        title: Title of the figure, to which ", one dot a sequence" is added.
        y: Label of the y axis.
        groups: Values of each group, by the label below its column.
        logarithmic: Axis with a logarithmic scale, "x" or "y"; None: neither.
    """
    figure, (axes,) = panels(1, width=9.0)
    for i, values in enumerate(groups.values()):
        aside = np.linspace(-0.2, 0.2, len(values))
        axes.plot(i + aside, values, ".", color=COLOURS[i % len(COLOURS)])
    axes.set_xticks(range(len(groups)), [label.replace("-", "\n", 1) for label in groups])
    axes.set(title=f"{title}, one dot a sequence", ylabel=y)
    _scale(axes, logarithmic)
    return figure


def intervals(title: str, x: str, groups: Mapping[str, Interval]) -> Figure:
    """Return a figure with one row for each value and its 95 % interval, drawn as a dot with a
    horizontal bar.

    Args:
        title: Title of the figure.
        x: Label of the x axis, to which ", with 95 % intervals" is added.
        groups: Value and interval, by the label of its row.
    """
    figure, (axes,) = figures.panels(7.0, 1.0 + ROW_HEIGHT * len(groups))
    values, ends = bars(list(groups.values()))
    axes.errorbar(values, range(len(groups)), xerr=ends, fmt="o", capsize=3, color=COLOURS[1])
    axes.set_yticks(range(len(groups)), list(groups))
    axes.invert_yaxis()
    axes.set(title=title, xlabel=f"{x}, with 95 % intervals")
    return figure


def bars(found: Sequence[Interval]) -> tuple[Array, Array]:
    """Return the values of n intervals (n,), and the lengths of their error bars below and above
    the value (2, n), as Matplotlib's `errorbar` takes them.
    """
    values = np.array([i.value for i in found])
    ends = np.array([(i.low, i.high) for i in found]).T
    return values, np.abs(ends - values)


def _scale(axes: Axes, logarithmic: Logarithmic) -> None:
    """Make an axis logarithmic, with plain numbers as labels."""
    if logarithmic is not None:
        axes.set(**{f"{logarithmic}scale": "log"})
        figures.plain_logarithm(axes.xaxis if logarithmic == "x" else axes.yaxis)
