"""A claim of a paper, with the runs that test it, the rule by which they are judged, and the
function that applies the rule.
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
    """Options that decide which runs test each claim: a quick check or all runs, the first seed,
    and a folder of real sequences.
    """

    quick: bool
    """True to run one seed of each claim, which no verdict uses, as a check of the code; runs of
    scenarios and painted sequences are short."""
    sequences: Path | None
    """Folder of real sequences for the claim that also uses them."""
    first: int | None = None
    """First seed of every claim; None: the seed that its rule names."""

    def seeds(self, full: int, first: int = FRESH) -> range:
        """Return the seeds of a claim's runs.

        Args:
            full: Number of seeds.
            first: First seed, unless these options have another one.

        Returns:
            Consecutive seeds; in a quick run only the seed 100000.
        """
        if self.quick:
            return range(QUICK, QUICK + 1)
        begin = first if self.first is None else self.first
        return range(begin, begin + full)

    @property
    def changes(self) -> tuple[str, ...]:
        """Changes of a scenario, such as "run.duration=2", that follow those of its claim: a
        shorter run if `quick`, else none.
        """
        return ("run.duration=2.0", "measure.after=1.0") if self.quick else ()

    @property
    def pictures(self) -> int | None:
        """Return the number of pictures that are used of each painted sequence; None: all."""
        return FEW if self.quick else None


@dataclass(frozen=True, slots=True)
class Evidence:
    """The results of a claim's runs, from which the claim is judged: the records of the runs, the
    options that decided which runs were made, and the folder with the runs' tracks.
    """

    records: list[Record]
    """Records of the runs in the order of the jobs."""
    effort: Effort
    folder: Path
    """Folder of the study, with the tracks of its runs."""

    @property
    def trackers(self) -> dict[str, list[Record]]:
        """Return the records by label of the tracker, in the order of the jobs."""
        return grouped_by(self.records, lambda record: record.settings[TRACKER])


@dataclass(frozen=True, slots=True)
class Rule:
    """The rule by which a claim is judged, in words, fixed before the first run: measure, settings,
    sample, bound, test and condition.
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
        """Return the same rule for runs whose seeds begin at `first`, which replaces the first seed
        in the text `units`.
        """
        return replace(self, units=SEED.sub(str(first), self.units))


@dataclass(frozen=True, slots=True)
class Verdict:
    """The result of testing a claim: the finding, the effect with its 95 % interval and unit, the
    number of independent units (`count`), the result in one sentence (`measured`), and a table and
    a figure.
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
    """A claim of a paper: its statement, the rule of its verdict, and the functions that return its
    runs and judge them.
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
    """Return the finding about a claim with several parts, given the finding of each part: it holds
    if all parts hold, does not hold if one part does not, and is undecided otherwise.
    """
    order = [Finding.HOLDS, Finding.UNDECIDED, Finding.DOES_NOT_HOLD]
    return max(findings, key=order.index)
