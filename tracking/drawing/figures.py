"""Axes, texts and PNG files of figures that Matplotlib draws."""

from io import BytesIO
from pathlib import Path

import numpy as np
from matplotlib import ticker
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure

from tracking.files import atomic

DOTS = 130
"""Resolution of a figure [dots per inch]."""
ROUNDING = 1e-9
"""Largest difference of values that counts as rounding."""
HALF = 0.5
"""Room above and below equal values, in their unit."""
SCREEN = 80
"""Resolution of a figure in a notebook [dots per inch]."""


class Drawing(Figure):
    """A Matplotlib figure that a notebook displays when it is the value of a cell."""

    def png(self) -> bytes:
        """Return the bytes of a PNG file with the figure."""
        file = BytesIO()
        self.savefig(file, format="png", dpi=SCREEN)
        return file.getvalue()

    _repr_png_ = png


def panels(
    width: float, height: float, rows: int = 1, columns: int = 1, *, sharex: bool = False
) -> tuple[Drawing, list[Axes]]:
    """Return a new figure and its axes, row by row, each with a light grid.

    Args:
        width: Width of the figure [inch].
        height: Height of the figure [inch].
        rows: Number of rows of axes.
        columns: Number of columns of axes.
        sharex: All axes have the same horizontal range.
    """
    figure = Drawing(figsize=(width, height), layout="constrained")
    axes = list(np.atleast_1d(figure.subplots(rows, columns, sharex=sharex)).ravel())
    for ax in axes:
        ax.grid(alpha=0.25)
        ax.spines[["top", "right"]].set_visible(False)
    return figure, axes


def hide_rounding(axes: Axes) -> None:
    """If all values drawn into axes are equal except for rounding (1e-9), let the vertical axis
    reach half a unit above and below them, or farther down if a lower end was set: they then look
    equal, and no line lies on an end of the axis. Else change nothing.
    """
    low, high = axes.dataLim.intervaly
    if 0 <= high - low < ROUNDING:
        end = low if axes.get_autoscaley_on() else axes.get_ylim()[0]
        axes.set_ylim(min(low - HALF, end), high + HALF)


def plain_logarithm(axis: Axis) -> None:
    """Label a logarithmic axis of Matplotlib at 1, 2 and 5 times powers of ten, by plain numbers
    such as 0.5; the axis is changed.
    """
    axis.set_major_locator(ticker.LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(ticker.StrMethodFormatter("{x:g}"))
    axis.set_minor_locator(ticker.NullLocator())


def literal(text: str) -> str:
    """Return a text with escaped dollar signs, so that Matplotlib does not parse it as formulas."""
    return text.replace("$", r"\$")


def save(figure: Figure, folder: Path, name: str) -> Path:
    """Write a figure as a PNG file into a folder, which is made if it does not exist, and return
    the file's path; an older file is replaced. `name` is the file's name, such as "errors.png".

    Raises:
        OSError: The file cannot be written.
    """
    with atomic.writing(folder, name) as file:
        figure.savefig(file, format="png", dpi=DOTS)
    return folder / name
