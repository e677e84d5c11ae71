"""A claim of a paper: what it says, the runs that test it, and how they are judged."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from servo.batch.jobs import Job
from servo.bench.sequence_jobs import Contender
from servo.bench.suites import TRACKERS
from sim import kinds
from sim.types import Array
from tracking.evaluation.drawing import figures
from tracking.evaluation.statistics import Interval

Result = dict[str, Any]
COLOURS = ("#c23b2e", "#2b6cb0", "#1f7a3a", "#b7791f", "#6b46c1", "#4b5563")


@dataclass(frozen=True, slots=True)
class Effort:
    """How much is run."""

    quick: bool
    """One seed of each, to see that all works: the numbers mean little."""
    sequences: Path | None
    """A folder of real sequences to add where a claim is about them."""

    def seeds(self, full: int) -> range:
        """Seeds 0, 1, ... up to the full number, or the first alone."""
        return range(1 if self.quick else full)


@dataclass(frozen=True, slots=True)
class Verdict:
    """What came out."""

    measured: str
    """In one sentence."""
    holds: bool
    table: list[list[str]] = field(default_factory=list)
    """Rows of cells, the first one heads them."""
    figures: list[Path] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class Claim:
    """One claim."""

    name: str
    says: str
    """What the paper says, in one sentence."""
    jobs: Callable[[Effort], Sequence[Job]]
    judge: Callable[[list[Result], Path], Verdict]
    """Of the results in the order of the jobs, and the folder for figures."""


def contender(
    kind: str, preset: str | None = None, label: str | None = None, **settings: Any
) -> Contender:
    """A tracker for an experiment; its label has the preset unless given."""
    begin = {} if preset is None else kinds.preset(TRACKERS, kind, preset)
    config = kinds.config_of(TRACKERS, kind)(**begin | settings)
    return Contender(label or (kind if preset is None else f"{kind}-{preset}"), config)


def group(results: Sequence[Result], **wanted: Any) -> list[Result]:
    """The results with these values."""
    return [r for r in results if all(r[key] == value for key, value in wanted.items())]


def column(results: Sequence[Result], measure: str) -> Array:
    """A measure over results (n,); nan where it does not apply."""
    found = [r["measures"][measure] for r in results]
    return np.array([np.nan if v is None else v for v in found], dtype=float)


def words(interval: Interval, unit: str = "") -> str:
    """Such as "2.1 px (1.9 to 2.4)"."""
    value = f"{interval.value:.3g} {unit}".rstrip()
    return f"{value} ({interval.low:.3g} to {interval.high:.3g})"


def axes(rows: int, columns: int = 1, width: float = 7.0) -> tuple[Figure, list[Axes]]:
    """A figure with plain axes, row by row."""
    figure = Figure(figsize=(width, 0.8 + 2.3 * rows), layout="constrained")
    FigureCanvasAgg(figure)
    found = list(np.atleast_1d(figure.subplots(rows, columns)).ravel())
    for ax in found:
        ax.grid(alpha=0.25)
        ax.spines[["top", "right"]].set_visible(False)
    return figure, found


def save(figure: Figure, folder: Path, name: str) -> Path:
    """Write a figure as NAME.png.

    Raises:
        OSError: The disk refuses.
    """
    return figures.save(figure, folder, f"{name}.png")
