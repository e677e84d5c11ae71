"""The command `servobench papers`: run the experiments and print the verdict on each claim."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.markup import escape

from servo.batch.workers import Workers
from servo.cli.terminal import complain, plain, print_table, work
from servo.mistake import Mistake, unknown
from servo.output.formats import command_line
from servo.output.result_folder import result_folder
from servo.output.versions import versions
from servo.papers.claim import WORDS, Claim, Effort, Evidence, Verdict
from servo.papers.claims import (
    CLAIMS,
    FIGURES,
    JOINED,
    TITLES,
    Judged,
    KnownVerdicts,
    PapersReport,
    known,
)
from servo.papers.groups import words
from servo.papers.loop_series import LoopSeries
from servo.papers.tuning import TUNING
from servo.report.words import Table
from sim.camera import gl
from tracking.drawing.figures import save
from tracking.files import atomic
from tracking.statistics.verdicts import Finding

TONES = {Finding.HOLDS: "green", Finding.DOES_NOT_HOLD: "red", Finding.UNDECIDED: "yellow"}


def run(names: Sequence[str], effort: Effort, workers: int, out: Path | None, quiet: bool) -> int:
    """Test claims; the exit code: 1 if a run failed, or a full run found another verdict than is
    known.

    Raises:
        Mistake: There is no such claim, or none of the claims uses the given sequences.
    """
    chosen = _chosen(names, effort)
    try:
        jobs = {claim.name: claim.jobs(effort) for claim in chosen}
    except ValueError as error:
        raise Mistake(str(error)) from None
    folder = out or Path("runs") / ("papers-quick" if effort.quick else "papers")
    console = Console(quiet=quiet)
    if any(isinstance(job, LoopSeries) for some in jobs.values() for job in some):
        gl.backend()
    runs = {job.key for some in jobs.values() for job in some}
    verdicts: dict[str, Verdict] = {}
    failed = 0
    with Workers(workers) as pool, result_folder(folder, "papers"):
        plain(console, f"claims: {len(chosen)}, runs: {len(runs)}")
        for claim in chosen:
            _print_rule(console, claim)
            results, code = work(jobs[claim.name], folder, pool, console, claim.name)
            if code:
                failed = code
                continue
            verdict = claim.judge(Evidence(results, effort, folder))
            if verdict.figure is not None:
                save(verdict.figure, atomic.folder(folder, FIGURES), f"{claim.name}.png")
            verdicts[claim.name] = verdict
            _print(console, verdict)
        again = command_line("papers", *names, quick=effort.quick, sequences=effort.sequences)
        tested = {c.name: Judged.of(c, verdicts[c.name]) for c in chosen if c.name in verdicts}
        written = PapersReport(
            command=again, versions=versions(), quick=effort.quick, claims=tested
        ).write(folder)
        found = KnownVerdicts.of(verdicts)
        found.write(folder)
    _print_rows(console, tested)
    plain(console, f"  {folder / FIGURES}\n  {written}")
    broken = [] if effort.quick else known().broken(found)
    for sentence in broken:
        complain(f"papers: {sentence}")
    return failed or (1 if broken else 0)


def _chosen(names: Sequence[str], effort: Effort) -> list[Claim]:
    """The claims of these names, or all.

    Raises:
        Mistake: There is no such claim, or none of the claims uses the given sequences.
    """
    there = {claim.name: claim for claim in (*CLAIMS, *TUNING)}
    for name in names:
        if name not in there:
            raise Mistake(f"papers: {unknown(name, there, 'claim')}")
    chosen = [there[name] for name in names] if names else list(CLAIMS)
    if effort.sequences is not None and there[JOINED] not in chosen:
        raise Mistake(f"papers: --sequences joins {JOINED}, which is not among these claims")
    return chosen


def _print_rule(console: Console, claim: Claim) -> None:
    """Print what is claimed and how it will be judged, before anything is run."""
    r = claim.rule
    console.print(f"\n[bold]{claim.name}[/] {escape(claim.says)}", highlight=False)
    for name, text in (
        ("measure", r.measure),
        ("settings", r.settings),
        ("units", r.units),
        ("margin", r.margin),
        ("test", r.test),
        ("holds", r.holds),
    ):
        console.print(f"  {name + ':':9} {escape(text)}", highlight=False)


def _print(console: Console, verdict: Verdict) -> None:
    word = WORDS[verdict.finding]
    tone = TONES[verdict.finding]
    effect = escape(f"{words(verdict.effect, verdict.unit)}, {verdict.count} units")
    console.print(f"  verdict:  [{tone}]{word}[/]: {effect}", highlight=False)
    console.print(f"  measured: {escape(verdict.measured)}", highlight=False)
    if verdict.table:
        head, *rows = verdict.table
        print_table(console, Table(head, rows, words=range(len(head))))


def _print_rows(console: Console, tested: dict[str, Judged]) -> None:
    """Print the claims as rows of a Markdown table, for the README of the papers."""
    plain(console, f"\n| {' | '.join(TITLES)} |\n|{'---|' * len(TITLES)}")
    for name, judged in tested.items():
        plain(console, judged.row(name))
