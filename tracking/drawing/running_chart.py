"""A chart over time that grows frame by frame, above bands in the statuses' colours."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.ticker import MaxNLocator

from tracking.drawing.colours import STATUS_ON_WHITE
from tracking.drawing.figures import DOTS

BAND = 0.07
"""Height of the bands, as a share of the axes."""
FIRST_END = 10.0
LONGER = 1.5
"""End of the time axis where it is not known [s], and its factor when it is reached."""
NICE = (1.0, 2.0, 5.0, 10.0)
"""First digits of the end of an axis that grows."""
LOWEST = 5.0
"""Least end of a vertical axis that grows."""
POINTS = 72
"""Of an inch: widths of lines are in points."""


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
    """A chart in axes, which grow where a value passes their end."""

    def __init__(self, axes: Axes, chart: Chart) -> None:
        """Begin a chart in empty axes."""
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
        """What changes with each frame; it is drawn upon everything else."""
        for artist in self.artists:
            artist.set_animated(True)
        self._times: list[float] = []
        self._values: list[Sequence[float]] = []
        self._statuses: list[Sequence[str]] = []
        self._end = chart.end or FIRST_END
        self._top = chart.top or LOWEST
        self._set_limits()

    def add(self, time: float, values: Sequence[float], statuses: Sequence[str]) -> bool:
        """Add a frame.

        Args:
            time: Later than that of the last call [s].
            values: One for each curve; nan leaves a gap.
            statuses: LOCKED, UNSURE or LOST of each band, from above.

        Returns:
            True if the axes have grown, so that they must be drawn anew.
        """
        self._times.append(time)
        self._statuses.append(statuses)
        self._values.append(values)
        for line, curve in zip(self._lines, np.transpose(self._values), strict=True):
            line.set_data(self._times, curve)
        height = BAND / len(statuses)
        places = [BAND - (i + 0.5) * height for i in range(len(statuses))]
        between = pairwise(self._times)
        self._band.set_segments([[(a, place), (b, place)] for a, b in between for place in places])
        self._band.set_linewidth(self._points / len(statuses))
        self._band.set_color([STATUS_ON_WHITE[s] for frame in self._statuses[1:] for s in frame])
        return self._grow(time, max(filter(math.isfinite, values), default=0.0))

    def _grow(self, time: float, value: float) -> bool:
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
