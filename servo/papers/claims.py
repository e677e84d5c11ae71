"""All claims, the file of their verdicts, and the verdicts that were found before."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import resources
from typing import ClassVar

from servo.output.formats import Document, Made
from servo.papers import (
    annealing_layers,
    estimator_study,
    kams_paper,
    kernel_paper,
    kernel_surface,
    particle_counts,
    servo_paper,
    texture_paper,
)
from servo.papers.claim import WORDS, Claim, Rule, Verdict
from servo.papers.groups import words
from tracking.files.json_text import number

CLAIMS = (
    *sorted(
        kams_paper.CLAIMS
        + annealing_layers.CLAIMS
        + particle_counts.CLAIMS
        + kernel_paper.CLAIMS
        + kernel_surface.CLAIMS
        + servo_paper.CLAIMS
        + texture_paper.CLAIMS,
        key=lambda claim: claim.name,
    ),
    *estimator_study.CLAIMS,
)
JOINED = "P0-1a"
"""The claim that also uses real sequences."""
FIGURES = "figures"
TITLES = ("claim", "rule", "effect", "95 % interval", "units", "verdict", "figure")


@dataclass(frozen=True, slots=True)
class Judged:
    """A claim with its rule and its verdict, as stored."""

    says: str
    rule: Rule
    finding: str
    effect: float | None
    low: float | None
    high: float | None
    """The effect's 95 % interval; None where there is none."""
    unit: str
    count: int
    """Number of units."""
    measured: str
    table: list[list[str]]
    """Rows of cells; the first row has the titles."""
    figures: list[str]
    """Paths relative to the folder."""

    @staticmethod
    def of(claim: Claim, verdict: Verdict) -> Judged:
        """Return a claim with its verdict."""
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
        """Return the claim's line in a Markdown table under `TITLES`."""
        effect, low, high = (
            "-" if value is None else f"{value:.3g}" for value in (self.effect, self.low, self.high)
        )
        cells = (
            f"{name} {self.says}",
            f"{self.rule.measure}; holds: {self.rule.holds}",
            f"{effect} {self.unit}",
            f"{low} to {high}",
            f"{self.count}: {self.rule.units}",
            self.finding,
            ", ".join(path.rpartition("/")[2] for path in self.figures),
        )
        return f"| {' | '.join(cells)} |"


@dataclass(frozen=True, slots=True, kw_only=True)
class PapersReport(Made):
    """papers.json of `servobench papers`."""

    FILE: ClassVar[str] = "papers.json"
    KIND: ClassVar[str] = "papers"

    quick: bool
    claims: dict[str, Judged]


@dataclass(frozen=True, slots=True)
class Known:
    """A verdict that was found before."""

    finding: str
    effect: str
    """With its interval and unit, in words."""


@dataclass(frozen=True, slots=True, kw_only=True)
class KnownVerdicts(Document):
    """verdicts.json: the verdicts of the last full run; a run that finds others exits with 1."""

    FILE: ClassVar[str] = "verdicts.json"
    KIND: ClassVar[str] = "verdicts"

    claims: dict[str, Known]

    @staticmethod
    def of(verdicts: dict[str, Verdict]) -> KnownVerdicts:
        """Return the verdicts of this run."""
        return KnownVerdicts(
            claims={
                name: Known(WORDS[v.finding], words(v.effect, v.unit))
                for name, v in verdicts.items()
            }
        )

    def broken(self, now: KnownVerdicts) -> list[str]:
        """Return a sentence for each claim of this run whose verdict is another one."""
        return [
            f"{name}: {new.finding}, {new.effect}; it was: {old.finding}, {old.effect}"
            for name, new in now.claims.items()
            if (old := self.claims.get(name)) is not None and old.finding != new.finding
        ]


def known() -> KnownVerdicts:
    """Return the verdicts that belong to this version."""
    with resources.as_file(resources.files("servo.papers") / KnownVerdicts.FILE) as path:
        return KnownVerdicts.read(path)
