"""A claim of a paper: its sentence, the rule of its verdict, the runs that test it, the judge."""

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from matplotlib.figure import Figure

from servo.study.run import Job, Record
from servo.study.sequence_run import TRACKER
from tracking.statistics.comparisons import Interval
from tracking.statistics.verdicts import Finding

WORDS = {f: f.name.lower().replace("_", " ") for f in Finding}
"""Each finding in a table."""
FRESH = 1000
"""First seed of verdicts; the settings are tuned with smaller ones."""
QUICK = 100_000
"""The seed of a quick run; no verdict uses it."""
SEED = re.compile(r"(?<=seeds from )\d+(?= on)|(?<=the first seed \()\d+(?=\))")
"""The first seed in the words of a rule's units."""


@dataclass(frozen=True, slots=True)
class Effort:
    """The number of runs that test each claim."""

    quick: bool
    """Run one seed of each, none of a verdict's, to check that everything works."""
    sequences: Path | None
    """A folder of real sequences that are added to the claim about them."""
    first: int | None = None
    """First seed of every claim; by default those that its rule names."""

    def seeds(self, full: int, first: int = FRESH) -> range:
        """Return seeds from the first on, up to the full number; `QUICK` alone if quick."""
        if self.quick:
            return range(QUICK, QUICK + 1)
        begin = first if self.first is None else self.first
        return range(begin, begin + full)


@dataclass(frozen=True, slots=True)
class Evidence:
    """The runs of a claim, which its judge is given."""

    records: list[Record]
    """In the order of the jobs."""
    effort: Effort
    folder: Path
    """Of the study, with the tracks of its runs."""

    @property
    def trackers(self) -> dict[str, list[Record]]:
        """The records of each tracker, in their order."""
        found: dict[str, list[Record]] = {}
        for record in self.records:
            found.setdefault(record.settings[TRACKER], []).append(record)
        return found


@dataclass(frozen=True, slots=True)
class Rule:
    """The rule of a verdict, written before any run."""

    measure: str
    settings: str
    units: str
    """The number and kind of what could have been otherwise."""
    margin: str
    test: str
    holds: str
    """The condition under which the claim holds."""

    def on(self, first: int) -> "Rule":
        """Return the rule for units with seeds from another one on."""
        return replace(self, units=SEED.sub(str(first), self.units))


@dataclass(frozen=True, slots=True)
class Verdict:
    """The result of testing a claim."""

    finding: Finding
    effect: Interval
    """The value that is compared with the bound, with its 95 % interval."""
    unit: str
    """Of the effect."""
    count: int
    """Number of units (`Rule.units`)."""
    measured: str
    """In one sentence."""
    table: list[list[str]] = field(default_factory=list)
    """Rows of cells; the first row has the titles."""
    figure: Figure | None = None


@dataclass(frozen=True, slots=True)
class Claim:
    """One claim."""

    name: str
    says: str
    """The paper's statement, in one sentence."""
    rule: Rule
    judge: Callable[[Evidence], Verdict]
    jobs: Callable[[Effort], Sequence[Job]] = lambda _: ()
    """The runs; there are none where the judge computes all by itself."""


def every(findings: Iterable[Finding]) -> Finding:
    """Return the finding about a claim that holds only if all its parts hold."""
    found = list(findings)
    if Finding.DOES_NOT_HOLD in found:
        return Finding.DOES_NOT_HOLD
    return Finding.UNDECIDED if Finding.UNDECIDED in found else Finding.HOLDS
