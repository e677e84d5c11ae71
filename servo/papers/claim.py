"""A claim of a paper: its sentence, the jobs that test it, and the function that judges them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from servo.batch.jobs import Job
from servo.papers.groups import Result
from tracking.evaluation.drawing import figures

COLOURS = ("#c23b2e", "#2b6cb0", "#1f7a3a", "#b7791f", "#6b46c1", "#4b5563")


@dataclass(frozen=True, slots=True)
class Effort:
    """How many runs test each claim."""

    quick: bool
    """Run one seed of each, to check that everything works: the numbers mean little."""
    sequences: Path | None
    """A folder of real sequences that are added to the claim about them."""

    def seeds(self, full: int) -> range:
        """Seeds 0, 1, ... up to the full number, or the first alone."""
        return range(1 if self.quick else full)


@dataclass(frozen=True, slots=True)
class Verdict:
    """The result of testing a claim."""

    measured: str
    """In one sentence."""
    holds: bool
    table: list[list[str]] = field(default_factory=list)
    """Rows of cells; the first row has the titles."""
    figures: list[Path] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class Claim:
    """One claim."""

    name: str
    says: str
    """What the paper says, in one sentence."""
    jobs: Callable[[Effort], Sequence[Job]]
    judge: Callable[[list[Result], Path], Verdict]
    """Takes the results in the order of the jobs, and the folder for figures."""


def panels(rows: int, columns: int = 1, width: float = 7.0) -> tuple[Figure, list[Axes]]:
    """A figure of the given width [inch] with plain axes, row by row."""
    return figures.panels(width, 0.8 + 2.3 * rows, rows, columns)
