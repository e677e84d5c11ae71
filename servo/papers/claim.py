"""A claim of a paper, with the runs that test it, the rule by which their results are judged, and
the function that applies the rule.
"""

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from matplotlib.figure import Figure

from servo.study.run import Job, Record, grouped_by
from servo.study.sequence_run import TRACKER
from tracking.statistics.comparisons import Interval
from tracking.statistics.verdicts import Finding

WORDS = {f: f.name.lower().replace("_", " ") for f in Finding}
"""Text of each finding."""
FRESH = 1000
"""First seed of verdicts; settings are tuned on smaller seeds."""
QUICK = 100_000
"""Seed of a quick run; no verdict uses it."""
FEW = 60
"""Number of pictures of a painted sequence in a quick run."""
SEED = re.compile(r"(?<=seeds from )\d+(?= on)|(?<=the first seed \()\d+(?=\))")
"""Matches the first seed in the text of a rule's units."""


@dataclass(frozen=True, slots=True)
class Effort:
    """Options that decide which runs test each claim: whether they are a quick check of the code or
    all runs, the folder of real sequences of pictures (None: none), and the first seed of every
    claim (None: the seed that its rule names).
    """

    quick: bool
    """True to run one seed of each claim, which no verdict uses, as a check of the code; runs of
    shipped scenarios and painted sequences are short."""
    sequences: Path | None
    """Folder of real sequences, which the claims P0-1a, P0-1b, P0-5 and P0-6 use besides painted
    ones; None: they use painted ones only."""
    first: int | None = None
    """First seed of every claim; None: the seed that its rule names."""

    def seeds(self, full: int, first: int = FRESH) -> range:
        """Return the seeds of a claim's runs: `full` consecutive ones, or only 100000 if `quick`.

        Args:
            full: Number of seeds, unless `quick`.
            first: First seed, unless `self.first` or `quick` gives another one.
        """
        if self.quick:
            return range(QUICK, QUICK + 1)
        begin = first if self.first is None else self.first
        return range(begin, begin + full)

    @property
    def changes(self) -> tuple[str, ...]:
        """Changes of a scenario's settings, such as "run.duration=2.0", that are made after those
        of a claim: they shorten the run if `quick`, else there are none.
        """
        return ("run.duration=2.0", "measure.after=1.0") if self.quick else ()

    @property
    def pictures(self) -> int | None:
        """Number of first pictures to which each painted (synthetic) sequence is cut: 60 if
        `quick`, else None (it is not cut).
        """
        return FEW if self.quick else None


@dataclass(frozen=True, slots=True)
class Evidence:
    """The results of a claim's runs, from which the claim is judged: the records of the runs, the
    options that decided which runs were made, and the study's folder, which has the trackers'
    estimates.
    """

    records: list[Record]
    """Records of the runs in the order of the jobs."""
    effort: Effort
    folder: Path
    """Folder of the study, with the tracks of its runs."""

    @property
    def trackers(self) -> dict[str, list[Record]]:
        """Return the records by label of the tracker; both labels and records are in the order of
        the runs.
        """
        return grouped_by(self.records, lambda record: record.settings[TRACKER])


@dataclass(frozen=True, slots=True)
class Rule:
    """The rule by which a claim is judged, fixed before the first run. Each part is a text: what is
    measured, settings of the compared methods, number and kind of the independent observations
    (`units`), bound of the effect (`margin`), statistical test, and the condition under which the
    claim holds.
    """

    measure: str
    """What is measured."""
    settings: str
    """Settings of the compared methods."""
    units: str
    """Number and kind of the independent units."""
    margin: str
    """Bound of the effect."""
    test: str
    """Statistical test or interval."""
    holds: str
    """Condition under which the claim holds."""

    def on(self, first: int) -> "Rule":
        """Return the same rule for runs whose first seed is `first`: a copy with this number in
        place of the first seed in the text `units`.
        """
        return replace(self, units=SEED.sub(str(first), self.units))


@dataclass(frozen=True, slots=True)
class Verdict:
    """The result of testing a claim: the finding (holds, does not hold or undecided), the effect
    with its 95 % interval and unit, the number of independent observations (`count`), the result in
    one sentence (`measured`), a table (its first row has the titles), and a figure (None: none).
    """

    finding: Finding
    effect: Interval
    """Value that is compared with the rule's bound, with its 95 % interval."""
    unit: str
    """Unit of the effect."""
    count: int
    """Number of independent units (`Rule.units`)."""
    measured: str
    """The result in one sentence."""
    table: list[list[str]] = field(default_factory=list)
    """Rows of cells; the first row has the titles."""
    figure: Figure | None = None


@dataclass(frozen=True, slots=True)
class Claim:
    """A claim of a paper: its short name, such as "P1-2", the paper's statement in one sentence
    (`says`), the rule of its verdict, a function that returns the verdict on the results of its
    runs (`judge`), and a function that returns the runs.
    """

    name: str
    """Short name, such as "P1-2"."""
    says: str
    """The paper's statement, in one sentence."""
    rule: Rule
    judge: Callable[[Evidence], Verdict]
    """Returns the verdict on the results of the runs."""
    jobs: Callable[[Effort], Sequence[Job]] = lambda _: ()
    """Returns the runs; none for a claim that `judge` tests by itself."""


def every(findings: Iterable[Finding]) -> Finding:
    """Return the finding about a claim with several parts: it holds if all parts hold, does not
    hold if one part does not, and is undecided otherwise.

    Args:
        findings: The finding of each part, at least one.
    """
    order = [Finding.HOLDS, Finding.UNDECIDED, Finding.DOES_NOT_HOLD]
    return max(findings, key=order.index)
