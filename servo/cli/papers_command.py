"""The command `servobench papers`: run the experiments and print the verdict on each claim."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape

from servo.batch.jobs import Done, Job, stored
from servo.batch.workers import Workers
from servo.cli.terminal import COMPILING, complain, plain, print_table, progress_bar, stop
from servo.mistake import FULL, Mistake, unknown
from servo.output.formats import command_line
from servo.output.result_folder import GOES_ON, result_folder
from servo.output.versions import versions
from servo.papers.claim import WORDS, Claim, Effort, Verdict
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
            figures = atomic.folder(folder, FIGURES)
            verdicts[claim.name] = verdict = claim.judge(results, figures)
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


FAILURES = "failures"


def work(
    jobs: Sequence[Job], folder: Path, pool: Workers, console: Console, title: str
) -> tuple[list[dict[str, Any]], int]:
    """Do jobs with a progress bar; the results in order, and the exit code: 1 for failures.

    Raises:
        Mistake: Two jobs have the same name.
        OSError: The disk is full.
    """
    keys = [job.key for job in jobs]
    double = next((key for key, count in Counter(keys).items() if count > 1), None)
    if double is not None:
        raise Mistake(f"two runs are called '{double}'; give the trackers different labels")
    done: dict[str, Done] = {}
    for job in jobs:
        try:
            if (result := stored(job, folder)) is not None:
                done[job.key] = Done(job, result)
        except Mistake as damaged:
            complain(f"{damaged}; it is computed again")
    todo = [job for job in jobs if job.key not in done]
    try:
        with progress_bar(console) as bar:
            task = bar.add_task(escape(title), total=len(jobs), completed=len(done), note=COMPILING)
            for one in pool.results(todo, folder):
                done[one.job.key] = one
                if one.refused is not None and one.refused.errno in FULL:
                    raise one.refused
                bar.update(task, advance=1, note=escape(one.job.key))
    except KeyboardInterrupt as cause:
        stop(cause, f"{GOES_ON.capitalize()}.")
    failed = [d for d in done.values() if d.result is None]
    for d in failed:
        reason = d.error.strip().splitlines()[-1]
        path = atomic.write(folder, f"{FAILURES}/{d.job.key}.txt", d.error)
        complain(f"{d.job.key} failed: {reason}; see {path}")
    results = [done[key].result for key in keys if key in done]
    return [r for r in results if r is not None], 1 if failed else 0
