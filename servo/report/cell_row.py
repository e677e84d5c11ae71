"""A study's cell as a row of a table."""

from __future__ import annotations

from collections.abc import Iterable

from servo.report.words import counted, shown, spread
from servo.study.results import Cell


def cell_row(cell: Cell, measures: Iterable[str]) -> list[str]:
    """Return axis values, units, the share held with its interval, and means of measures."""
    means = (shown(mean and mean.value) for mean in map(cell.means.get, measures))
    axes = map(shown, cell.settings.values())
    return [*axes, counted(cell.success, cell.unit), spread(cell.success), *means]
