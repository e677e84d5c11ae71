"""The section about the papers' claims: what they say, what was measured, what held."""

from __future__ import annotations

import json
import shlex
from dataclasses import dataclass
from pathlib import Path

from servo.batch.jobs import RESULTS
from servo.papers.claims import SUMMARY
from servo.report import files
from servo.report.page import Badge, Block, Fact, Picture, Section, Table, versions


@dataclass(frozen=True, slots=True)
class Claimed:
    """A claim and what came out."""

    says: str
    measured: str
    holds: bool
    table: list[list[str]]
    figures: list[str]


@dataclass(frozen=True, slots=True)
class Written:
    """papers.json."""

    version: str
    quick: bool
    claims: dict[str, Claimed]


def section(folder: Path) -> Section:
    """All about a folder of the papers' experiments.

    Raises:
        Mistake: A file is missing or broken.
    """
    papers = files.read(folder / SUMMARY, Written)
    held = sum(c.holds for c in papers.claims.values())
    whole = len(papers.claims)
    verdict = Badge.of(held == whole, *[f"{held} of {whole} hold"] * 2)
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
        _again(folder, papers),
    ]
    lead = "Claims of the three papers, tested again."
    return Section("papers", folder.resolve().name, lead, verdict, facts, blocks, str(folder))


def _claim(folder: Path, name: str, claim: Claimed) -> Block:
    head, *rows = claim.table or [[]]
    pictures = [
        Picture.of("", files.content(folder / figure), str(folder / figure), sheet=False)
        for figure in claim.figures
    ]
    word = "holds" if claim.holds else "does not hold"
    text = [f"Paper: {claim.says}.", f"Measured: {claim.measured}."]
    tables = [Table(head, rows)] if head else []
    return Block(f"{name} {word}", text, tables=tables, pictures=pictures)


def _again(folder: Path, papers: Written) -> Block:
    line = ["servobench", "papers", *papers.claims, *(["--quick"] if papers.quick else [])]
    for place in _recorded(folder):
        line += ["--sequences", place]
    told = versions({"servobench": papers.version})
    return Block("Again", tables=[told], code=[shlex.join(line)])


def _recorded(folder: Path) -> set[str]:
    """Folders of real sequences that joined the painted ones, as the results name them."""
    found: set[str] = set()
    for path in (folder / RESULTS).rglob("*.json"):
        try:
            job = json.loads(files.content(path))["job"]
            found.add(str(job["sequence"]["folder"]))
        except (ValueError, KeyError, TypeError):
            continue  # a painted sequence, a run in the closed loop, or half a file
    return found
