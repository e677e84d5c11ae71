"""The command `servobench papers`: run the experiments and print whether each claim holds."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.markup import escape

from servo.batch.workers import Workers
from servo.cli.terminal import plain, print_table, work
from servo.mistake import Mistake, unknown
from servo.output.formats import command_line
from servo.output.result_folder import result_folder
from servo.output.versions import versions
from servo.papers import estimator_study, servo_paper
from servo.papers.claim import Claim, Effort, Verdict
from servo.papers.claims import CLAIMS, FIGURES, JOINED, Judged, PapersReport
from servo.report.words import Table
from sim import gl
from tracking.files import atomic


def run(names: Sequence[str], effort: Effort, workers: int, out: Path | None, quiet: bool) -> int:
    """Test claims; the exit code: 1 if one does not hold or a run failed.

    The numbers of a quick run do not change its exit code: one seed is too few.

    Raises:
        Mistake: There is no such claim, or none of the claims uses the given sequences.
    """
    known = {claim.name: claim for claim in CLAIMS}
    for name in names:
        if name not in known:
            raise Mistake(f"papers: {unknown(name, known, 'claim')}")
    chosen = [known[name] for name in names] if names else list(CLAIMS)
    if effort.sequences is not None and known[JOINED] not in chosen:
        raise Mistake(f"papers: --sequences joins {JOINED}, which is not among these claims")
    try:
        jobs = {claim.name: claim.jobs(effort) for claim in chosen}
    except ValueError as error:
        raise Mistake(str(error)) from None
    folder = out or Path("runs") / ("papers-quick" if effort.quick else "papers")
    console = Console(quiet=quiet)
    if any(claim in (*servo_paper.CLAIMS, *estimator_study.CLAIMS) for claim in chosen):
        gl.backend()
    verdicts: dict[str, Verdict] = {}
    failed = 0
    with Workers(workers) as pool, result_folder(folder, "papers"):
        for claim in chosen:
            results, code = work(jobs[claim.name], folder, pool, console, claim.name)
            if code:
                failed = code
                continue
            figures = atomic.folder(folder, FIGURES)
            verdicts[claim.name] = verdict = claim.judge(results, figures)
            _print(console, claim, verdict)
        again = command_line("papers", *names, quick=effort.quick, sequences=effort.sequences)
        tested = {name: Judged.of(known[name], verdict) for name, verdict in verdicts.items()}
        written = PapersReport(
            command=again, versions=versions(), quick=effort.quick, claims=tested
        ).write(folder)
    plain(console, f"  {folder / FIGURES}\n  {written}")
    missed = [name for name, verdict in verdicts.items() if not verdict.holds]
    return failed or (1 if missed and not effort.quick else 0)


def _print(console: Console, claim: Claim, verdict: Verdict) -> None:
    word = "[green]holds[/]" if verdict.holds else "[red]does not hold[/]"
    console.print(f"\n[bold]{claim.name}[/] {word}", highlight=False)
    console.print(f"  paper:    {escape(claim.says)}", highlight=False)
    console.print(f"  measured: {escape(verdict.measured)}", highlight=False)
    if verdict.table:
        print_table(console, Table(verdict.table[0], verdict.table[1:]))
