"""Plots of one run over time: errors, and the target's own motion, like figures 9 and 10 of the
multi-kernel paper (Teuliere, Marchand, Eck).
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from servo.output.run_curves import Panel, RunCurves
from tracking.drawing.colours import CURVES
from tracking.drawing.figures import Drawing, hide_rounding, literal, panels, save

STYLES: dict[str, dict[str, Any]] = {
    "measured": {"color": "#b8bcc4", "lw": 0.9},
    "estimated": {"color": "#1f7a3a", "lw": 1.6},
    "true": {"color": "#111111", "lw": 1.0, "ls": "--"},
}
"""Styles of the lines of the target's motion."""
ABOVE: dict[str, Any] = {
    "loc": "lower right",
    "bbox_to_anchor": (1.0, 1.0),
    "borderaxespad": 0.1,
}
"""Place of a legend above its axes, where it hides no curve."""
HEIGHT = 2.4
MARGINS = 0.6
"""Height of the axes of a plot, and of title and time axis [inch]."""


def figure(curves: RunCurves, title: str) -> Drawing:
    """Return one figure of a run with plots over time: the feature errors, the distances of the
    true centre from the goal and from its estimate [px], and the target's own motion. Times are
    shaded at which the camera delivered no picture, or the tracker's status is not LOCKED.
    """
    return _drawn(curves, title, [curves.errors(), curves.distances(), *curves.motions()])


def draw(curves: RunCurves, title: str, folder: Path) -> list[Path]:
    """Write two figures of a run into a folder, which is made if it does not exist: the target's
    own motion as target_motion.png, and the errors as errors.png, both over time. Their titles
    begin with `title`. Return their paths in this order.

    Raises:
        OSError: A file cannot be written.
    """
    motion = save(motion_figure(curves, title), folder, "target_motion.png")
    return [motion, save(error_figure(curves, title), folder, "errors.png")]


def motion_figure(curves: RunCurves, title: str) -> Drawing:
    """Return the figure of the target's own motion in the image over time, as rates of change of
    the image features (like figure 9 of Teuliere, Marchand, Eck).

    Each feature for which the feature set proposes feed-forward (or each feature, if it proposes
    none) has a plot of its own with the measured, the estimated and the true rate, unless the true
    and the estimated rate are zero or unknown in all frames. If this leaves no plot, the first of
    these features has one.
    """
    return _drawn(curves, f"{title}: the target's own motion", curves.motions())


def error_figure(curves: RunCurves, title: str) -> Drawing:
    """Return the figure of a run's errors: the feature errors over time, and below them the
    distances [px] of the true centre from the goal and from the estimate (like figure 10 of
    Teuliere, Marchand, Eck).
    """
    return _drawn(curves, f"{title}: errors", [curves.errors(), curves.distances()])


def _drawn(curves: RunCurves, title: str, shown: Sequence[Panel]) -> Drawing:
    """Return the figure of some plots below each other, shaded at times at which the camera
    delivered no picture, or the tracker's status is not LOCKED.
    """
    time = curves["time_s"]
    whole, axes = panels(8, MARGINS + HEIGHT * len(shown), len(shown), sharex=True)
    for ax, panel in zip(axes, shown, strict=True):
        for i, (name, values) in enumerate(panel.lines.items()):
            style = STYLES.get(name, {"color": CURVES[i % len(CURVES)], "lw": 1.3})
            ax.plot(time, values, label=name, **style)
        ax.margins(x=0)
        ax.set(ylabel=panel.axis)
        if panel.low is not None:
            ax.set_ylim(panel.low, panel.high)
        if panel.high is None:
            hide_rounding(ax)
        ax.legend(ncols=4, frameon=False, **ABOVE)
        across = ax.get_xaxis_transform()
        # Each picture until the next one: a single one would have no width.
        shaded = np.append(curves.unsure[:1], curves.unsure[1:] | curves.unsure[:-1])
        ax.fill_between(
            time,
            0,
            1,
            where=shaded,
            transform=across,
            color="#d9d2c3",
            alpha=0.7,
            lw=0,
        )
    whole.suptitle(literal(title), x=0.01, ha="left")
    axes[-1].set_xlabel("time [s]")
    return whole
