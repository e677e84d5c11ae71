"""The section of an HTML report about the papers' claims: rules, effects and verdicts."""

from collections import Counter
from pathlib import Path

from servo.papers.claim import WORDS
from servo.papers.claims import Judged, PapersReport, marked
from servo.report.page import Block, Fact, PageImage, Section, again
from servo.report.words import Badge, Table, Tone, shown
from tracking.statistics.verdicts import Finding

TONES = {WORDS[Finding.HOLDS]: Tone.GOOD, WORDS[Finding.DOES_NOT_HOLD]: Tone.BAD}


def section(folder: Path) -> Section:
    """Return the section of an HTML report about a folder that `servobench papers` wrote: the
    claims of the papers with their rules, effects and verdicts.

    Raises:
        Mistake: A file is missing or damaged.
    """
    papers = PapersReport.read(folder / PapersReport.FILE)
    found = Counter(c.finding for c in papers.claims.values())
    verdict = Badge(", ".join(f"{n} {name}" for name, n in found.items()), Tone.PLAIN)
    facts = [
        Fact("verdicts", verdict),
        Fact(
            "effort",
            "quick" if papers.quick else "full",
            "one seed of each: the numbers mean little" if papers.quick else "",
        ),
    ]
    if papers.first_seed is not None:
        facts.append(Fact("first seed", str(papers.first_seed), "not the registered seeds"))
    rows = [
        [name, _badge(name, c), c.says, _effect(c), c.measured] for name, c in papers.claims.items()
    ]
    head = ("claim", "", "the paper says", "effect, 95 % interval, units", "measured")
    blocks = [
        Block("Claims", tables=[Table(head, rows, words=range(5))]),
        *(_claim(folder, name, claim) for name, claim in papers.claims.items()),
        again(papers),
    ]
    lead = "Claims of the three papers, tested again."
    return Section("papers", folder.resolve().name, lead, verdict, facts, blocks, str(folder))


def _claim(folder: Path, name: str, claim: Judged) -> Block:
    head, *rows = claim.table or [[]]
    pictures = [PageImage.read(folder / figure) for figure in claim.figures]
    r = claim.rule
    text = [
        f"Paper: {claim.says}.",
        f"Rule: {r.measure}; settings: {r.settings}; units: {r.units}; margin: {r.margin}; test: "
        f"{r.test}; it holds if: {r.holds}.",
        f"Measured: {claim.measured}.",
        f"Effect: {_effect(claim)}.",
    ]
    tables = [Table(head, rows)] if head else []
    return Block(f"{name}: {marked(name, claim.finding)}", text, tables=tables, pictures=pictures)


def _badge(name: str, claim: Judged) -> Badge:
    return Badge(marked(name, claim.finding), TONES.get(claim.finding, Tone.PLAIN))


def _effect(claim: Judged) -> str:
    interval = f"{shown(claim.low)} to {shown(claim.high)}"
    return f"{shown(claim.effect)} {claim.unit} ({interval}), {claim.count} units"
