"""The curves of a run over time, read from its table of steps, for plots, notebooks and web
pages.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from servo.mistake import Mistake
from servo.output.formats import RUN_AGAIN
from servo.output.steps_table import TABLE, ending, ending_of_rate
from servo.parts import FeatureSet
from sim.types import Array
from tracking.types import Status

MIDDLE = (1, 99)
"""Percentiles of the measured motion between which its plot shows it; outliers may be outside."""
ROOM = 0.1
LEAST = 0.02
"""Room above and below the curves, as a share of their range; and the least range from which this
room is computed, in the feature's unit per second.
"""
REST = 1e-9
"""Largest rate of a feature of a target at rest, by rounding [the feature's unit per second]."""


@dataclass(frozen=True, slots=True)
class Panel:
    """The data of one plot of a run over time: its title, the title of its vertical axis with the
    unit, the values (n,) of each line at the run's n frames by name, and the limits of the vertical
    axis (None: those of the values).
    """

    title: str
    axis: str
    """Title of the vertical axis, with its unit."""
    lines: Mapping[str, Array]
    """Values (n,) by the name of the line."""
    low: float | None = None
    high: float | None = None
    """Limits of the vertical axis; None: those of the values."""


@dataclass(frozen=True, slots=True)
class RunCurves:
    """The table of a run's steps, with names and units of its features, from which the data of
    plots are read: `curves["time_s"]` is a column as an array (n,).
    """

    table: pa.Table
    units: Mapping[str, str]
    """Unit of each feature by name; "1": a number without unit."""
    feed_forward: Sequence[str]
    """Features for which the feature set proposes feed-forward."""
    place: str = TABLE
    """The file of the table, for messages."""

    @staticmethod
    def of(table: pa.Table, features: FeatureSet) -> "RunCurves":
        """Return the curves of a run from its table of steps (a row for each frame) and its image
        features.
        """
        units = dict(zip(features.names, features.units, strict=True))
        return RunCurves(table, units, features.feed_forward)

    def __getitem__(self, name: str) -> Array:
        """Return a column of numbers (n,).

        Raises:
            Mistake: The table has no such column of numbers.
        """
        return self._column(name, float)

    def _column(self, name: str, kind: type) -> NDArray[Any]:
        try:
            return self.table[name].to_numpy().astype(kind)
        except (KeyError, TypeError, ValueError):
            raise Mistake(
                f"{self.place}: column '{name}' is missing or has no numbers: {RUN_AGAIN}"
            ) from None

    @property
    def unsure(self) -> NDArray[np.bool_]:
        """Flags (n,): true where the camera delivered no picture (the frame was dropped) or the
        tracker was not LOCKED.
        """
        locked = self._column("status", str) == Status.LOCKED.name
        return ~((self["fresh"] > 0) & locked)

    def distances(self) -> Panel:
        """Return the plot of two distances [px]: of the target's true centre from its goal, and of
        its estimated centre from its true one.
        """
        lines = {
            "true centre to goal": self["servo_error_px"],
            "estimated to true centre": self["tracking_error_px"],
        }
        title = "Distance from goal, and of the estimate"
        return Panel(title, "distance [px]", lines, low=0)

    def errors(self) -> Panel:
        """Return the plot of all feature errors s - s* (current minus desired value), each in the
        feature's unit.
        """
        lines = {
            f"{name} [{unit}]": self["_".join(filter(None, ("error", name, ending(unit))))]
            for name, unit in self.units.items()
        }
        return Panel("Feature errors", "feature error s - s*", lines)

    def motions(self) -> list[Panel]:
        """Return plots of the target's own motion, one for each feature for which the feature set
        proposes feed-forward (the setting `controller.feed_forward` does not count), or for each
        feature if it proposes none.

        Features whose true and estimated rates are zero or nan in all frames are left out. If no
        feature remains, as for a target at rest without an estimator, the plot of the first one is
        returned.
        """
        names = [name for name in self.feed_forward or self.units if name in self.units]
        every = [self._motion(name) for name in names]
        return [panel for panel in every if _moves(panel)] or every[:1]

    def _motion(self, feature: str) -> Panel:
        """Return the plot of the rate of change of a feature that the target's own motion causes,
        in the feature's unit per second: measured, estimated and true.

        The true rate is nan in the first frame. The limits of the plot show the middle 98 % of the
        measured rate, so that its outliers may lie outside.
        """
        unit = self.units[feature]
        lines = {
            which: self[f"motion_{which}_{feature}_{ending_of_rate(unit)}"]
            for which in ("measured", "estimated", "true")
        }
        lines["true"][:1] = np.nan
        measured = lines["measured"]
        finite = measured[np.isfinite(measured)]
        middle = np.percentile(finite, MIDDLE) if len(finite) else np.zeros(1)
        every = np.concatenate([middle, lines["estimated"], lines["true"]])
        low = float(np.nanmin(every))
        high = float(np.nanmax(every))
        room = ROOM * max(high - low, LEAST)
        title = f"The target's own motion: {feature}"
        return Panel(
            title, f"d{feature}/dt of the target [{unit}/s]", lines, low - room, high + room
        )


def _moves(panel: Panel) -> bool:
    """Return True if a plot of the target's own motion has a true or estimated rate that is not
    zero.
    """
    rates = np.concatenate([panel.lines["estimated"], panel.lines["true"]])
    return bool((np.abs(rates) > REST).any())
