"""Success and precision plots of trackers, means over many runs (Wu, Lim, Yang 2013)."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tracking.drawing.colours import CURVES
from tracking.drawing.figures import literal, panels, save
from tracking.evaluation.track_measures import NEAR, OVERLAPS, PIXELS

STYLES = ("-", "--", ":", "-.")


def draw(
    results: Sequence[Mapping[str, Any]], order: Sequence[str], title: str, folder: Path
) -> list[Path]:
    """Write success.png and precision.png, with the mean curve of each tracker over its runs, and
    return their paths.

    Args:
        results: A table for each run with the name of its "tracker" and its curves: "success"
            (21,), shares of frames whose overlap (intersection over union) exceeds 0, 0.05 ... 1,
            and "precision" (51,), shares of frames whose centre error is at most 0, 1 ... 50 px.
        order: Names of the trackers in the order of the legend.
        title: Name of the suite of sequences.
        folder: Folder of the files.

    Raises:
        OSError: A file cannot be written.
    """
    wanted = {
        "success": (OVERLAPS, "overlap threshold", "share of frames above it", None),
        "precision": (PIXELS, "error threshold [px]", "share of frames within it", NEAR),
    }
    paths: list[Path] = []
    for name, (thresholds, below, beside, mark) in wanted.items():
        figure, (ax,) = panels(6.4, 4.6)
        for i, label in enumerate(order):
            curve = np.mean([r[name] for r in results if r["tracker"] == label], axis=0)
            score = curve.mean() if mark is None else curve[mark]
            dashes = STYLES[i // len(CURVES) % len(STYLES)]
            colour = CURVES[i % len(CURVES)]
            name_and_score = f"{literal(label)} [{score:.3f}]"
            ax.plot(thresholds, curve, dashes, color=colour, lw=1.5, label=name_and_score)
        ax.set(xlabel=below, ylabel=beside, title=f"{literal(title)}: {name}", ylim=(0, 1.02))
        ax.margins(x=0)
        ax.legend(fontsize=7, ncols=1 + len(order) // 9, frameon=False)
        paths.append(save(figure, folder, f"{name}.png"))
    return paths
