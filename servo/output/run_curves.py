"""The curves of a run, read from its table of steps, for plots, notebooks and pages."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from servo.mistake import Mistake
from servo.output.steps_table import TABLE, ending, ending_of_rate
from servo.parts import FeatureSet
from sim.types import Array
from tracking.types import Status

MIDDLE = (1, 99)
"""Percentiles of the measured motion that its figure shows; outliers may be outside."""
ROOM = 0.1
LEAST = 0.02
"""Room above and below the curves, over their range; and the least range, in the feature's unit
per second.
"""


@dataclass(frozen=True, slots=True)
class Motion:
    """The rate of change of one feature that the target's own motion causes, over n frames (n,)
    [feature's unit/s]: measured, estimated and true.
    """

    measured: Array
    estimated: Array
    true: Array
    """nan in the first frame, before which there is no motion."""

    @property
    def limits(self) -> tuple[float, float]:
        """Lower and upper limit of a plot's axis; outliers of `measured` may lie outside."""
        finite = self.measured[np.isfinite(self.measured)]
        middle = np.percentile(finite, MIDDLE) if len(finite) else np.zeros(1)
        every = np.concatenate([middle, self.estimated, self.true])
        low = float(np.nanmin(every))
        high = float(np.nanmax(every))
        room = ROOM * max(high - low, LEAST)
        return low - room, high + room


@dataclass(frozen=True, slots=True)
class RunCurves:
    """The table of a run's steps, with names and units of its features, read by column."""

    table: pa.Table
    units: Mapping[str, str]
    """Unit of each feature by name; 1: a number without unit."""
    feed_forward: Sequence[str]
    """Features whose motion is fed forward."""
    place: str = TABLE
    """The file of the table, for messages."""

    @staticmethod
    def of(table: pa.Table, features: FeatureSet) -> "RunCurves":
        """Return the curves of a run from its table of steps and its features."""
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
            raise Mistake(f"{self.place}: column '{name}' is missing or has no numbers") from None

    @property
    def moving(self) -> list[str]:
        """Names of the features whose motion is drawn: those fed forward, else all."""
        return [name for name in self.feed_forward or self.units if name in self.units]

    @property
    def unsure(self) -> NDArray[np.bool_]:
        """Flags (n,): true where the frame was dropped or the tracker was not LOCKED."""
        locked = self._column("status", str) == Status.LOCKED.name
        return ~((self["fresh"] > 0) & locked)

    def error(self, feature: str) -> Array:
        """Return the error s - s* of a feature over the frames (n,), in the feature's unit."""
        return self[_name("error", feature, ending(self.units[feature]))]

    def motion(self, feature: str) -> Motion:
        """Return the rate of change of a feature that the target's own motion causes; the true rate
        is nan in the first frame.
        """
        rate = ending_of_rate(self.units[feature])
        measured, estimated, true = (
            self[_name(f"motion_{which}", feature, rate)]
            for which in ("measured", "estimated", "true")
        )
        true[:1] = np.nan
        return Motion(measured, estimated, true)


def _name(*words: str) -> str:
    """Return the name of a column: its parts, of which the last may be empty, joined by "_"."""
    return "_".join(filter(None, words))
