"""Plots of one run, like figures 9 and 10 of the multi-kernel paper (Teuliere, Marchand, Eck)."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes

from servo.output.run_curves import RunCurves
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


def figure(curves: RunCurves, title: str) -> Drawing:
    """Return one figure of a run: over time the feature errors, the distances of the true centre
    from goal and estimate [px], and the target's own motion.
    """
    rows = len(curves.moving)
    whole, axes = _figure(2 + rows, 5.4 + 2.4 * rows)
    _draw_errors(curves, literal(title), axes[:2])
    _draw_motion(curves, literal(title), axes[2:])
    return whole


def draw(curves: RunCurves, title: str, folder: Path) -> list[Path]:
    """Write target_motion.png and errors.png into a folder; return their paths in this order."""
    title = literal(title)
    motion = save(motion_figure(curves, title), folder, "target_motion.png")
    return [motion, save(error_figure(curves, title), folder, "errors.png")]


def motion_figure(curves: RunCurves, title: str) -> Drawing:
    """Return the figure of the target's own motion in the image over time, as rates of the features
    (like figure 9 of Teuliere, Marchand, Eck).

    Each fed-forward feature has axes of its own, with the measured, estimated and true rate.
    """
    rows = len(curves.moving)
    figure, axes = _figure(rows, 0.6 + 2.4 * rows)
    _draw_motion(curves, title, axes)
    return figure


def error_figure(curves: RunCurves, title: str) -> Drawing:
    """Return the figure of a run's errors: the feature errors over time, and below them the
    distances [px] of the true centre from the goal and from the estimate (like figure 10 of
    Teuliere, Marchand, Eck).
    """
    figure, axes = _figure(2, 5.4)
    _draw_errors(curves, title, axes)
    return figure


def _figure(rows: int, height: float) -> tuple[Drawing, list[Axes]]:
    figure, axes = panels(8, height, rows, sharex=True)
    for ax in axes:
        ax.margins(x=0)
    axes[-1].set_xlabel("time [s]")
    return figure, axes


def _draw_motion(curves: RunCurves, title: str, axes: Sequence[Axes]) -> None:
    time = curves["time_s"]
    for name, ax in zip(curves.moving, axes, strict=True):
        motion = curves.motion(name)
        ax.plot(time, motion.measured, color=MEASURED, lw=0.9, label="measured")
        ax.plot(time, motion.estimated, color=ESTIMATED, lw=1.6, label="estimated")
        ax.plot(time, motion.true, color=TRUE, lw=1.0, ls="--", label="true")
        ax.set_ylim(motion.limits)
        ax.set_ylabel(f"d{name}/dt of the target [{curves.units[name]}/s]")
        _shade_unseen(ax, curves)
    axes[0].legend(ncols=3, **ABOVE)
    axes[0].set_title(f"{title}: the target's own motion", loc="left")


def _draw_errors(curves: RunCurves, title: str, axes: Sequence[Axes]) -> None:
    time = curves["time_s"]
    for i, (name, unit) in enumerate(curves.units.items()):
        ink = CURVES[i % len(CURVES)]
        axes[0].plot(time, curves.error(name), color=ink, lw=1.3, label=f"{name} [{unit}]")
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


def _shade_unseen(ax: Axes, curves: RunCurves) -> None:
    across = ax.get_xaxis_transform()
    ax.fill_between(
        curves["time_s"],
        0,
        1,
        where=curves.unsure,
        transform=across,
        color="#d9d2c3",
        alpha=0.7,
        lw=0,
    )
