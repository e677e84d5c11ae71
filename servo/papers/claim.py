"""A claim of a paper: its sentence, the rule of its verdict, the jobs that test it, the judge."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from matplotlib import ticker
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure

from servo.batch.jobs import Job
from servo.papers.groups import Result
from tracking.drawing import figures
from tracking.statistics.comparisons import Interval
from tracking.statistics.verdicts import Finding

COLOURS = ("#c23b2e", "#2b6cb0", "#1f7a3a", "#b7791f", "#6b46c1", "#4b5563", "#0e7490")
WORDS = {f: f.name.lower().replace("_", " ") for f in Finding}
"""Each finding in a table."""
FRESH = 1000
"""First seed of verdicts; the settings are tuned with smaller ones."""
QUICK = 100_000
"""The seed of a quick run."""


@dataclass(frozen=True, slots=True)
class Effort:
    """How many runs test each claim."""

    quick: bool
    """Run one seed of each, none of a verdict's, to check that everything works."""
    sequences: Path | None
    """A folder of real sequences that are added to the claim about them."""

    def seeds(self, full: int, first: int = FRESH) -> range:
        """Seeds from the first on, up to the full number of them; `QUICK` alone if quick."""
        return range(QUICK, QUICK + 1) if self.quick else range(first, first + full)


@dataclass(frozen=True, slots=True)
class Rule:
    """How a claim is judged, written before any run."""

    measure: str
    settings: str
    units: str
    """What could have been otherwise, and how many of them there are."""
    margin: str
    test: str
    holds: str
    """When the claim holds."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """The result of testing a claim."""

    finding: Finding
    effect: Interval
    """What was compared with the bound, with its 95 % interval."""
    unit: str
    """Of the effect."""
    count: int
    """Number of units (`Rule.units`)."""
    measured: str
    """In one sentence."""
    table: list[list[str]] = field(default_factory=list)
    """Rows of cells; the first row has the titles."""
    figures: list[Path] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class Claim:
    """One claim."""

    name: str
    says: str
    """What the paper says, in one sentence."""
    rule: Rule
    jobs: Callable[[Effort], Sequence[Job]]
    judge: Callable[[list[Result], Path], Verdict]
    """Takes the results in the order of the jobs, and the folder for figures."""


def every(findings: Iterable[Finding]) -> Finding:
    """The finding about a claim that holds only if all its parts hold."""
    found = list(findings)
    if Finding.DOES_NOT_HOLD in found:
        return Finding.DOES_NOT_HOLD
    return Finding.UNDECIDED if Finding.UNDECIDED in found else Finding.HOLDS


def panels(rows: int, columns: int = 1, width: float = 7.0) -> tuple[Figure, list[Axes]]:
    """A figure of the given width [inch] with plain axes, row by row."""
    return figures.panels(width, 0.8 + 2.3 * rows, rows, columns)


def plain_ticks(*axes: Axis) -> None:
    """Ticks such as 0.5, 1, 2 on logarithmic axes."""
    for axis in axes:
        axis.set_major_locator(ticker.LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter(ticker.StrMethodFormatter("{x:g}"))
        axis.set_minor_locator(ticker.NullLocator())
