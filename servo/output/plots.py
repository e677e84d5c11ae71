"""Plots of one run, like figures 9 and 10 of the multi-kernel paper (Teuliere, Marchand, Eck)."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from servo.loop.step import Step
from tracking.drawing.colours import CURVES
from tracking.drawing.figures import Drawing, literal, panels, save

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


def figure(steps: Sequence[Step], title: str) -> Drawing:
    """Both plots of a run in one figure."""
    names = _moving(steps)
    whole, axes = _figure(2 + len(names), 5.4 + 2.4 * len(names))
    _draw_errors(steps, literal(title), axes[:2])
    _draw_motion(steps, literal(title), axes[2:])
    return whole


def draw(steps: Sequence[Step], title: str, folder: Path) -> list[Path]:
    """Write both plots of a run as PNG files into a folder; their paths."""
    title = literal(title)
    motion = save(motion_figure(steps, title), folder, "target_motion.png")
    return [motion, save(error_figure(steps, title), folder, "errors.png")]


def motion_figure(steps: Sequence[Step], title: str) -> Drawing:
    """Draw figure 9: the target's own motion in the image, measured, estimated and true."""
    rows = len(_moving(steps))
    figure, axes = _figure(rows, 0.6 + 2.4 * rows)
    _draw_motion(steps, title, axes)
    return figure


def error_figure(steps: Sequence[Step], title: str) -> Drawing:
    """Draw figure 10: the feature errors, and below them the true distance from the goal."""
    figure, axes = _figure(2, 5.4)
    _draw_errors(steps, title, axes)
    return figure


def _figure(rows: int, height: float) -> tuple[Drawing, list[Axes]]:
    figure, axes = panels(8, height, rows, sharex=True)
    for ax in axes:
        ax.margins(x=0)
    axes[-1].set_xlabel("time [s]")
    return figure, axes


def _moving(steps: Sequence[Step]) -> tuple[str, ...]:
    """Names of the features for which the target's motion is drawn."""
    features = steps[0].scene.features
    return features.feed_forward or features.names


def _draw_motion(steps: Sequence[Step], title: str, axes: Sequence[Axes]) -> None:
    features = steps[0].scene.features
    names = _moving(steps)
    time = [s.frame.time for s in steps]
    for name, ax in zip(names, axes, strict=True):
        i = features.names.index(name)
        measured = np.array([s.motion_measured[i] for s in steps])
        estimated = np.array([s.prediction.motion[i] for s in steps])
        true = np.array([s.target_motion_true[i] for s in steps])
        ax.plot(time, measured, color=MEASURED, lw=0.9, label="measured")
        ax.plot(time, estimated, color=ESTIMATED, lw=1.6, label="estimated")
        ax.plot(time[1:], true[1:], color=TRUE, lw=1.0, ls="--", label="true")
        middle = np.nanpercentile(measured, MIDDLE) if np.isfinite(measured).any() else [0]
        shown = np.concatenate([middle, estimated, true[1:]])
        shown = shown[np.isfinite(shown)]
        room = 0.1 * max(float(np.ptp(shown)), 0.02)
        ax.set_ylim(shown.min() - room, shown.max() + room)
        ax.set_ylabel(f"d{name}/dt of the target [{features.units[i]}/s]")
        _shade_unseen(ax, steps)
    axes[0].legend(ncols=3, **ABOVE)
    axes[0].set_title(f"{title}: the target's own motion", loc="left")


def _draw_errors(steps: Sequence[Step], title: str, axes: Sequence[Axes]) -> None:
    time = [s.frame.time for s in steps]
    features = steps[0].scene.features
    for i, (name, unit) in enumerate(zip(features.names, features.units, strict=True)):
        error = [s.error[i] for s in steps]
        axes[0].plot(time, error, color=CURVES[i % len(CURVES)], lw=1.3, label=f"{name} [{unit}]")
    axes[0].set_ylabel("feature error s - s*")
    axes[0].legend(ncols=4, **ABOVE)
    axes[0].set_title(f"{title}: errors", loc="left")
    servo = [s.servo_error for s in steps]
    tracking = [s.tracking_error for s in steps]
    axes[1].plot(time, servo, color=CURVES[0], lw=1.5, label="true centre to goal")
    axes[1].plot(time, tracking, color=CURVES[1], lw=1.0, label="estimated to true centre")
    axes[1].set_ylabel("distance [px]")
    axes[1].set_ylim(bottom=0)
    axes[1].legend(ncols=2, **ABOVE)
    for ax in axes:
        _shade_unseen(ax, steps)


def _shade_unseen(ax: Axes, steps: Sequence[Step]) -> None:
    time = [s.frame.time for s in steps]
    unseen = [not s.seen for s in steps]
    across = ax.get_xaxis_transform()
    ax.fill_between(time, 0, 1, where=unseen, transform=across, color="#d9d2c3", alpha=0.7, lw=0)
