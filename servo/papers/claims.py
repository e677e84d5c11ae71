"""All claims, and the file of their verdicts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from servo.output.formats import Made
from servo.papers import estimator_study, kams_paper, kernel_paper, servo_paper, texture_paper
from servo.papers.claim import Claim, Verdict

CLAIMS = (
    *kams_paper.CLAIMS, *kernel_paper.CLAIMS, *servo_paper.CLAIMS, *texture_paper.CLAIMS,
    *estimator_study.CLAIMS,
)  # fmt: skip
JOINED = "P0-1"
"""The claim that also uses real sequences."""
FIGURES = "figures"


@dataclass(frozen=True, slots=True)
class Judged:
    """A claim with its verdict, as stored."""

    says: str
    measured: str
    holds: bool
    table: list[list[str]]
    """Rows of cells; the first row has the titles."""
    figures: list[str]
    """Paths relative to the folder."""

    @staticmethod
    def of(claim: Claim, verdict: Verdict) -> Judged:
        """A claim with its verdict."""
        figures = [f"{FIGURES}/{path.name}" for path in verdict.figures]
        return Judged(claim.says, verdict.measured, bool(verdict.holds), verdict.table, figures)


@dataclass(frozen=True, slots=True, kw_only=True)
class PapersReport(Made):
    """papers.json of `servobench papers`."""

    FILE: ClassVar[str] = "papers.json"
    KIND: ClassVar[str] = "papers"

    quick: bool
    claims: dict[str, Judged]
