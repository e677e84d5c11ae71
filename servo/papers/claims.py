"""The list of all claims of the papers, the file papers.json with their verdicts, and the verdicts
of the last full run, with which those of a new run are compared.
"""

import json
from dataclasses import dataclass
from importlib import resources
from typing import ClassVar

from servo.output.formats import Made
from servo.papers import (
    estimator_study,
    kams_paper,
    kernel_paper,
    law_paper,
    servo_paper,
    texture_paper,
)
from servo.papers.claim import WORDS, Claim, Rule, Verdict
from servo.papers.summaries import words
from tracking.files.json_text import number
from tracking.statistics.verdicts import Finding

CLAIMS = (
    *sorted(
        kams_paper.CLAIMS
        + kernel_paper.CLAIMS
        + law_paper.CLAIMS
        + servo_paper.CLAIMS
        + texture_paper.CLAIMS,
        key=lambda claim: claim.name,
    ),
    *estimator_study.CLAIMS,
)
JOINED = ("P0-1a", "P0-1b", "P0-5", "P0-6")
"""The claims that also use real sequences; one has to be among the tested ones if some are
given."""
FIGURES = "figures"
VERDICTS = "verdicts.json"
"""File of the findings of the last full run; a run with other findings exits with 1."""
TITLES = ("claim", "rule", "effect", "95 % interval", "units", "verdict", "figure")


@dataclass(frozen=True, slots=True)
class Judged:
    """A claim with its rule and its verdict, as the file papers.json has them: effect and the ends
    of its 95 % interval (None: unknown) in `unit`, number of independent observations, result in
    one sentence, table, and paths of figures relative to the file's folder.
    """

    says: str
    rule: Rule
    finding: str
    effect: float | None
    low: float | None
    high: float | None
    """Upper end of the effect's 95 % interval; None if unknown."""
    unit: str
    count: int
    """Number of units."""
    measured: str
    table: list[list[str]]
    """Rows of cells; the first row has the titles."""
    figures: list[str]
    """Paths of figures, relative to the folder of papers.json."""

    @staticmethod
    def of(claim: Claim, verdict: Verdict) -> "Judged":
        """Return a claim and its verdict in the form of the file papers.json."""
        return Judged(
            claim.says,
            claim.rule,
            WORDS[verdict.finding],
            number(verdict.effect.value),
            number(verdict.effect.low),
            number(verdict.effect.high),
            verdict.unit,
            verdict.count,
            verdict.measured,
            verdict.table,
            [] if verdict.figure is None else [f"{FIGURES}/{claim.name}.png"],
        )

    def row(self, name: str) -> str:
        """Return the claim as a line of a Markdown table with the columns claim, rule, effect, 95 %
        interval, units (independent observations), verdict and figure.

        Args:
            name: The claim's name, such as "P1-2".
        """
        effect, low, high = (
            "-" if value is None else f"{value:.3g}" for value in (self.effect, self.low, self.high)
        )
        cells = (
            f"{name} {self.says}",
            f"{self.rule.measure}; holds: {self.rule.holds}",
            f"{effect} {self.unit}",
            f"{low} to {high}",
            f"{self.count}: {self.rule.units}",
            marked(name, self.finding),
            ", ".join(path.rpartition("/")[2] for path in self.figures),
        )
        return f"| {' | '.join(cells)} |"


@dataclass(frozen=True, slots=True, kw_only=True)
class PapersReport(Made):
    """The contents of the file papers.json: the verdicts of `servobench papers` on the claims that
    it tested, by name of the claim, and the options that decided the runs.
    """

    FILE: ClassVar[str] = "papers.json"
    KIND: ClassVar[str] = "papers"

    quick: bool
    first_seed: int | None = None
    """First seed of every claim; None: the seed that its rule names."""
    claims: dict[str, Judged]


BY_CONSTRUCTION = frozenset({"P0-3", "P1-4a", "P1-4b", "P1-5a", "P1-5b", "P1-6a", "P1-6b", "P2-3b"})
"""Names of claims that hold for nearly any tested method."""
WITHOUT_POWER = frozenset({"P0-4", "P0-7", "P0-8"})
"""Names of claims whose number of units is too small for a narrow interval."""


def marked(name: str, finding: str) -> str:
    """Return the text of a claim's finding, such as "holds", with a note in brackets if it says
    little: "by construction" if nearly any method would keep the claim, "power" if there are too
    few observations to decide it.

    Args:
        name: The claim's name, such as "P1-2".
        finding: Text of the finding.
    """
    notes = {
        WORDS[Finding.HOLDS]: (BY_CONSTRUCTION, "by construction"),
        WORDS[Finding.UNDECIDED]: (WITHOUT_POWER, "power"),
    }
    names, note = notes.get(finding, ((), ""))
    return f"{finding} ({note})" if name in names else finding


Found = dict[str, tuple[str, str]]
"""Texts of finding and effect by name of the claim."""


def found_in(verdicts: dict[str, Verdict]) -> Found:
    """Return the texts of finding and effect, such as "holds" and "2.1 px (1.9 to 2.4)", of each
    verdict, by name of the claim.
    """
    return {name: (WORDS[v.finding], words(v.effect, v.unit)) for name, v in verdicts.items()}


def known() -> Found:
    """Return the texts of finding and effect of each claim in the last full run, by name of the
    claim, from servobench's own file verdicts.json.
    """
    return json.loads((resources.files("servo.papers") / VERDICTS).read_text())


def broken(found: Found, before: Found) -> list[str]:
    """Return a sentence for each claim whose finding differs between two runs.

    Args:
        found: Texts of finding and effect in the new run, by name of the claim.
        before: The same texts in the last full run; claims that are missing here are not compared.
    """
    return [
        f"{name}: {', '.join(new)}; it was: {', '.join(before[name])}"
        for name, new in found.items()
        if name in before and before[name][0] != new[0]
    ]
