"""A chart over time that is drawn further frame by frame, above a band in the status's colours."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import cv2
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from sim.types import Array, Image
from tracking.drawing.colours import STATUS_ON_WHITE
from tracking.drawing.figures import DOTS

BAND = 0.07
"""Height of the band, as a share of the axes."""
FIRST_END = 10.0
LONGER = 1.5
"""End of the time axis where it is not known [s], and its factor when it is reached."""
SUBPIXEL_BITS = 4
"""OpenCV then takes places in sixteenths of a pixel, so that curves are smooth."""
PAD = 0.1
"""Space to the left and right [inch]."""
WIDTH = 2
"""Of a curve [px]."""
NICE = (1.0, 2.0, 5.0, 10.0)
"""First digits of the end of an axis that grows."""
LOWEST = 5.0
"""Least end of a vertical axis that grows."""


def pixels(figure: Figure) -> Image:
    """A figure as an RGB picture (H, W, 3)."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()


def rgb(colour: str) -> tuple[int, int, int]:
    """The values 0..255 of a colour such as "#1f7a3a"."""
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:], 16)


@dataclass(frozen=True, slots=True)
class Chart:
    """Curves that share an axis from 0 up."""

    curves: Mapping[str, str]
    """Colours by name."""
    label: str
    """Of the vertical axis."""
    end: float | None = None
    """Of the time axis [s]; None: it is not known."""
    top: float | None = None
    """Of the vertical axis; None: it grows with the values."""


class RunningChart:
    """A drawing of a chart; both axes grow where a value passes their end."""

    def __init__(self, width: int, height: int, chart: Chart) -> None:
        """Begin a drawing of a size [px]."""
        self._size = (width, height)
        self._chart = chart
        self._end = chart.end or FIRST_END
        self._top = chart.top or 0.0
        self._rows: list[tuple[float, Sequence[float], str]] = []
        self.picture = np.zeros((0, 0, 3), np.uint8)

    def add(self, time: float, values: Sequence[float], status: str) -> Image:
        """The chart (H, W, 3) up to a time [s], which the next call goes on with.

        Args:
            time: Later than that of the last call.
            values: One for each curve; nan leaves a gap.
            status: LOCKED, UNSURE or LOST.
        """
        self._rows.append((time, values, status))
        if self._too_small(time, max(filter(math.isfinite, values), default=0.0)):
            self._redraw()
        else:
            self._join(self._rows[-2:])
        return self.picture

    def _too_small(self, time: float, value: float) -> bool:
        longer = time > self._end
        higher = self._chart.top is None and value > self._top
        if longer:
            self._end = max(self._end * LONGER, time)
        if higher or not self._top:
            least = max(value, LOWEST)
            size = 10.0 ** math.floor(math.log10(least))
            self._top = size * next(n for n in NICE if n * size >= least)
        return longer or higher or not self.picture.size

    def _redraw(self) -> None:
        width, height = self._size
        figure = Figure((width / DOTS, height / DOTS), dpi=DOTS, layout="constrained")
        figure.get_layout_engine().set(w_pad=PAD, h_pad=PAD / 2)  # type: ignore[call-arg]
        axes = figure.add_subplot()
        for name, colour in self._chart.curves.items():
            axes.plot([], [], color=colour, lw=1.5, label=name)
        axes.set_xlim(0, self._end)
        axes.set_xlabel("time [s]", size=8)
        axes.set_ylabel(self._chart.label, size=8)
        axes.set_ylim(-2 * BAND * self._top, 1.02 * self._top)
        axes.set_yticks([t for t in axes.get_yticks() if 0 <= t <= self._top])
        axes.grid(alpha=0.25)
        axes.spines[["top", "right"]].set_visible(False)
        axes.tick_params(labelsize=7)
        axes.legend(
            loc="lower right",
            bbox_to_anchor=(1.0, 0.98),
            ncols=len(self._chart.curves),
            frameon=False,
            fontsize=8,
            borderaxespad=0.0,
        )
        self.picture = pixels(figure)
        origin, one = axes.transData.transform([[0, 0], [1, 1]])
        self._origin = (origin[0], height - origin[1])
        self._unit = (one - origin) * (1, -1)
        if len(self._rows) == 1:
            self._join(self._rows * 2)
        self._join(self._rows)

    def _join(self, rows: Sequence[tuple[float, Sequence[float], str]]) -> None:
        """Draw all curves through these rows, and the band below."""
        times = [time for time, _, _ in rows]
        unit = 1 << SUBPIXEL_BITS
        for colour, values in zip(
            self._chart.curves.values(), np.transpose([v for _, v, _ in rows]), strict=True
        ):
            points = self._at(times, np.minimum(values, self._top))
            for begin, end in pairwise(points):
                if np.isfinite([begin, end]).all():
                    a, b = (np.round(unit * (p - 0.5)).astype(int).tolist() for p in (begin, end))
                    cv2.line(self.picture, a, b, rgb(colour), WIDTH, cv2.LINE_AA, SUBPIXEL_BITS)
        low, high = self._at([0.0, 0.0], np.array([-2.0, -1.0]) * BAND * self._top)[:, 1]
        across = self._at(times, np.zeros(len(times)))[:, 0].round().astype(int).tolist()
        for (_, _, status), (left, right) in zip(rows[1:], pairwise(across), strict=True):
            self.picture[round(high) + 1 : round(low), left : right + 1] = rgb(
                STATUS_ON_WHITE[status]
            )

    def _at(self, times: Sequence[float], values: Array) -> Array:
        """Places in the picture (n, 2) [px]."""
        return self._origin + np.column_stack([times, values]) * self._unit
