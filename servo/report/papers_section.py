"""The section about the papers' claims: their sentences, what was measured, and which hold."""

from __future__ import annotations

from pathlib import Path

from servo.output.formats import content
from servo.papers.claims import Judged, PapersReport
from servo.report.page import Block, Fact, PageImage, Section, again
from servo.report.words import Badge, Table


def section(folder: Path) -> Section:
    """The section about a folder of the papers' experiments.

    Raises:
        Mistake: A file is missing or damaged.
    """
    papers = PapersReport.read(folder / PapersReport.FILE)
    held = sum(c.holds for c in papers.claims.values())
    whole = len(papers.claims)
    verdict = Badge.of(held == whole, f"{held} of {whole} hold")
    facts = [
        Fact("claims that hold", verdict),
        Fact("effort", "quick" if papers.quick else "full",
             "one seed of each: the numbers mean little" if papers.quick else ""),
    ]  # fmt: skip
    rows = [
        [name, Badge.of(c.holds, "holds", "does not hold"), c.says, c.measured]
        for name, c in papers.claims.items()
    ]
    summary = Table(("claim", "", "the paper says", "measured"), rows, words=range(4))
    blocks = [
        Block("Claims", tables=[summary]),
        *(_claim(folder, name, claim) for name, claim in papers.claims.items()),
        again(papers),
    ]
    lead = "Claims of the three papers, tested again."
    return Section("papers", folder.resolve().name, lead, verdict, facts, blocks, str(folder))


def _claim(folder: Path, name: str, claim: Judged) -> Block:
    head, *rows = claim.table or [[]]
    pictures = [
        PageImage.of("", content(folder / figure), str(folder / figure), sheet=False)
        for figure in claim.figures
    ]
    word = "holds" if claim.holds else "does not hold"
    text = [f"Paper: {claim.says}.", f"Measured: {claim.measured}."]
    tables = [Table(head, rows)] if head else []
    return Block(f"{name} {word}", text, tables=tables, pictures=pictures)
