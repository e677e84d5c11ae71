"""A study's cell as a row of a table."""

from collections.abc import Iterable

from servo.report.words import counted, shown, spread
from servo.study.results import Cell


def cell_row(cell: Cell, measures: Iterable[str]) -> list[str]:
    """Its axis values, its units, the share held with its interval, and means of measures.

    A mean over a part of the runs says how many these are: "2.1 (1 of 10)".
    """
    means: list[str] = []
    for name in measures:
        mean = cell.means.get(name)
        part = f" ({cell.finite[name]} of {cell.runs})" if cell.finite[name] < cell.runs else ""
        means.append(shown(mean.value) + part if mean else shown(None))
    axes = map(shown, cell.settings.values())
    return [*axes, counted(cell.success, cell.unit), spread(cell.success), *means]
