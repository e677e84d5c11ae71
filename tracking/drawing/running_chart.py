"""Chart over time of a film: curves that grow frame by frame, and bands in the status's colours."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.ticker import MaxNLocator

from tracking.drawing.colours import STATUS_ON_WHITE
from tracking.drawing.figures import DOTS

BAND = 0.07
"""Height of the bands, as a share of the axes' height."""
FIRST_END = 10.0
"""First end of the time axis if the film's end is unknown [s]."""
LONGER = 1.5
"""Factor on the end of the time axis when a frame exceeds it."""
NICE = (1.0, 2.0, 5.0, 10.0)
"""First digits of the end of a growing vertical axis."""
LOWEST = 5.0
"""First end of a growing vertical axis."""
POINTS = 72
"""Points in an inch; widths of lines are in points."""


@dataclass(frozen=True, slots=True)
class Chart:
    """Settings of a chart over time: the colours of its curves by the names in the legend, the
    label of their common vertical axis, which begins at 0, and the ends of the time axis [s] (None:
    unknown) and of the vertical axis (None: the axis grows with the values).
    """

    curves: Mapping[str, str]
    """Colour of each curve by the curve's name in the legend."""
    label: str
    """Label of the vertical axis, with the unit of the values."""
    end: float | None = None
    """End of the time axis [s], which grows for later frames; None: it begins with 10 s."""
    top: float | None = None
    """End of the vertical axis; None: it grows with the values."""


class RunningChart:
    """Draws curves and coloured bands of a film over time, frame by frame, into Matplotlib's
    `axes`. The time axis is extended when a frame is later than its end; the vertical axis, unless
    the chart sets its end (`top`), when a value exceeds it.
    """

    def __init__(self, axes: Axes, chart: Chart) -> None:
        """Set up empty axes with the settings of a chart."""
        self._axes = axes
        self._grows = chart.top is None
        axes.set_xlabel("time [s]", size=8)
        axes.set_ylabel(chart.label, size=8)
        axes.grid(alpha=0.25)
        axes.spines[["top", "right"]].set_visible(False)
        axes.tick_params(labelsize=7)
        self._lines = [
            axes.plot([], [], color=colour, lw=1.5, label=name)[0]
            for name, colour in chart.curves.items()
        ]
        axes.legend(
            loc="lower right",
            bbox_to_anchor=(1.0, 0.98),
            ncols=len(chart.curves),
            frameon=False,
            fontsize=8,
            borderaxespad=0.0,
        )
        self._points = BAND * axes.get_window_extent().height * POINTS / DOTS
        self._band = LineCollection([], antialiaseds=False, transform=axes.get_xaxis_transform())
        axes.add_collection(self._band)
        self.artists: Sequence[Artist] = (*self._lines, self._band)
        """The artists that change with each frame; they are drawn above everything else."""
        for artist in self.artists:
            artist.set_animated(True)
        self._times: list[float] = []
        self._values: list[Sequence[float]] = []
        self._pieces: dict[float, list[tuple[float, float, str]]] = {}
        """Pieces of each band, by its height in the axes: begin and end [s], and status."""
        self._end = chart.end or FIRST_END
        self._top = chart.top or LOWEST
        self._set_limits()

    def add(self, time: float, values: Sequence[float], statuses: Sequence[str]) -> bool:
        """Extend the curves and the coloured bands to the time of a frame.

        Args:
            time: Time of the frame [s], later than that of the last one.
            values: A value for each curve; nan leaves a gap.
            statuses: Name of a `Status`, such as "LOCKED", or "" for none, for each band, from top
                to bottom.

        Returns:
            True if the axes have grown, so that the whole figure must be drawn again.
        """
        self._extend_bands(time, statuses)
        self._times.append(time)
        self._values.append(values)
        for line, curve in zip(self._lines, np.transpose(self._values), strict=True):
            line.set_data(self._times, curve)
        return self._grow(time, max(filter(math.isfinite, values), default=0.0))

    def _extend_bands(self, time: float, statuses: Sequence[str]) -> None:
        """Extend the coloured bands from the last frame to a time [s]. Frames of one status are one
        piece of a band, so that a long film has few pieces.
        """
        if not self._times:
            return
        height = BAND / len(statuses)
        for i, status in enumerate(statuses):
            pieces = self._pieces.setdefault(BAND - (i + 0.5) * height, [])
            if pieces and pieces[-1][2] == status:
                pieces[-1] = (pieces[-1][0], time, status)
            else:
                pieces.append((self._times[-1], time, status))
        every = [(place, *piece) for place, pieces in self._pieces.items() for piece in pieces]
        self._band.set_segments([[(a, place), (b, place)] for place, a, b, _ in every])
        self._band.set_linewidth(self._points / len(statuses))
        self._band.set_color([STATUS_ON_WHITE[status] for *_, status in every])

    def _grow(self, time: float, value: float) -> bool:
        """Extend the time axis to a time [s] and, unless its end is set, the vertical axis to a
        value; return True if one of them has grown.
        """
        longer = time > self._end
        higher = self._grows and value > self._top
        if longer:
            self._end = max(self._end * LONGER, time)
        if higher:
            size = 10.0 ** math.floor(math.log10(value))
            self._top = size * next(n for n in NICE if n * size >= value)
        if longer or higher:
            self._set_limits()
        return longer or higher

    def _set_limits(self) -> None:
        self._axes.set_xlim(0, self._end)
        self._axes.set_ylim(-2 * BAND * self._top, 1.02 * self._top)
        ticks = MaxNLocator(4).tick_values(0, self._top)
        self._axes.set_yticks([tick for tick in ticks if 0 <= tick <= self._top])
