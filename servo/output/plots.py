"""Plots of one run, like figures 9 and 10 of the multi-kernel paper (Teuliere, Marchand, Eck)."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from matplotlib.axes import Axes

from servo.output.steps_table import feature_columns
from servo.parts import FeatureSet
from sim.types import Array
from tracking.drawing.colours import CURVES
from tracking.drawing.figures import Drawing, literal, panels, save
from tracking.types import Status

MEASURED = "#b8bcc4"
ESTIMATED = "#1f7a3a"
TRUE = "#111111"
"""Colours of the target's motion."""
ABOVE: dict[str, Any] = {
    "loc": "lower right",
    "bbox_to_anchor": (1.0, 1.0),
    "borderaxespad": 0.1,
    "frameon": False,
}
"""A legend above its axes, where it hides no curve."""
MIDDLE = (1, 99)
"""Percentiles of the measured motion that the plot shows; outliers may be outside."""
OF_RUN = ("time_s", "servo_error_px", "tracking_error_px", "fresh", "status")
SHOWN = ("error", "motion_measured", "motion_estimated", "motion_true")
"""Columns that are drawn, and quantities of the features."""


@dataclass(frozen=True, slots=True)
class Curves:
    """The table of a run's steps, and the features that it has."""

    table: pa.Table
    features: FeatureSet

    @staticmethod
    def read(path: Path, features: FeatureSet) -> "Curves":
        """Read from a file what the plots show.

        Raises:
            OSError: It cannot be read.
        """
        every = feature_columns(features)
        own = [name for quantity in SHOWN for name in every[quantity]]
        return Curves(pq.read_table(path, columns=[*OF_RUN, *own]), features)

    def __getitem__(self, name: str) -> Array:
        """Return a column (n,)."""
        return self.table[name].to_numpy()

    def of(self, quantity: str, feature: int) -> Array:
        """Return one of a feature's columns (n,), such as its "error"."""
        return self[feature_columns(self.features)[quantity][feature]]

    @property
    def moving(self) -> tuple[str, ...]:
        """Names of the features for which the target's motion is drawn."""
        return self.features.feed_forward or self.features.names


def figure(curves: Curves, title: str) -> Drawing:
    """Both plots of a run in one figure."""
    rows = len(curves.moving)
    whole, axes = _figure(2 + rows, 5.4 + 2.4 * rows)
    _draw_errors(curves, literal(title), axes[:2])
    _draw_motion(curves, literal(title), axes[2:])
    return whole


def draw(curves: Curves, title: str, folder: Path) -> list[Path]:
    """Write both plots of a run as PNG files into a folder; their paths."""
    title = literal(title)
    motion = save(motion_figure(curves, title), folder, "target_motion.png")
    return [motion, save(error_figure(curves, title), folder, "errors.png")]


def motion_figure(curves: Curves, title: str) -> Drawing:
    """Draw figure 9: the target's own motion in the image, measured, estimated and true."""
    rows = len(curves.moving)
    figure, axes = _figure(rows, 0.6 + 2.4 * rows)
    _draw_motion(curves, title, axes)
    return figure


def error_figure(curves: Curves, title: str) -> Drawing:
    """Draw figure 10: the feature errors, and below them the true distance from the goal."""
    figure, axes = _figure(2, 5.4)
    _draw_errors(curves, title, axes)
    return figure


def _figure(rows: int, height: float) -> tuple[Drawing, list[Axes]]:
    figure, axes = panels(8, height, rows, sharex=True)
    for ax in axes:
        ax.margins(x=0)
    axes[-1].set_xlabel("time [s]")
    return figure, axes


def _draw_motion(curves: Curves, title: str, axes: Sequence[Axes]) -> None:
    features = curves.features
    time = curves["time_s"]
    for name, ax in zip(curves.moving, axes, strict=True):
        i = features.names.index(name)
        measured = curves.of("motion_measured", i)
        estimated = curves.of("motion_estimated", i)
        true = curves.of("motion_true", i)
        ax.plot(time, measured, color=MEASURED, lw=0.9, label="measured")
        ax.plot(time, estimated, color=ESTIMATED, lw=1.6, label="estimated")
        ax.plot(time[1:], true[1:], color=TRUE, lw=1.0, ls="--", label="true")
        middle = np.nanpercentile(measured, MIDDLE) if np.isfinite(measured).any() else [0]
        shown = np.concatenate([middle, estimated, true[1:]])
        shown = shown[np.isfinite(shown)]
        room = 0.1 * max(float(np.ptp(shown)), 0.02)
        ax.set_ylim(shown.min() - room, shown.max() + room)
        ax.set_ylabel(f"d{name}/dt of the target [{features.units[i]}/s]")
        _shade_unseen(ax, curves)
    axes[0].legend(ncols=3, **ABOVE)
    axes[0].set_title(f"{title}: the target's own motion", loc="left")


def _draw_errors(curves: Curves, title: str, axes: Sequence[Axes]) -> None:
    time = curves["time_s"]
    features = curves.features
    for i, (name, unit) in enumerate(zip(features.names, features.units, strict=True)):
        error = curves.of("error", i)
        axes[0].plot(time, error, color=CURVES[i % len(CURVES)], lw=1.3, label=f"{name} [{unit}]")
    axes[0].set_ylabel("feature error s - s*")
    axes[0].legend(ncols=4, **ABOVE)
    axes[0].set_title(f"{title}: errors", loc="left")
    axes[1].plot(
        time, curves["servo_error_px"], color=CURVES[0], lw=1.5, label="true centre to goal"
    )
    axes[1].plot(
        time, curves["tracking_error_px"], color=CURVES[1], lw=1.0, label="estimated to true centre"
    )
    axes[1].set_ylabel("distance [px]")
    axes[1].set_ylim(bottom=0)
    axes[1].legend(ncols=2, **ABOVE)
    for ax in axes:
        _shade_unseen(ax, curves)


def _shade_unseen(ax: Axes, curves: Curves) -> None:
    unseen = ~(curves["fresh"] & (curves["status"] == Status.LOCKED.name))
    across = ax.get_xaxis_transform()
    ax.fill_between(
        curves["time_s"], 0, 1, where=unseen, transform=across, color="#d9d2c3", alpha=0.7, lw=0
    )
