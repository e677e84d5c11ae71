"""The command `servobench papers`: run experiments on the claims of the three papers again, and
print the verdict on each claim.
"""

from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path

from rich.console import Console

from servo.cli.jobs import complete_jobs, print_estimate
from servo.cli.terminal import complain, escape, plain, print_paths, print_table
from servo.mistake import Mistake, as_mistake, check_known
from servo.output.formats import command_line
from servo.output.versions import versions
from servo.papers.claim import FRESH, WORDS, Claim, Effort, Evidence, Verdict
from servo.papers.claims import (
    CLAIMS,
    FIGURES,
    JOINED,
    TITLES,
    VERDICTS,
    Found,
    Judged,
    PapersReport,
    broken,
    found_in,
    known,
)
from servo.papers.experiments import EstimatedLoop
from servo.papers.summaries import words
from servo.papers.tuning import TUNING
from servo.report.words import Table
from servo.study.execute import Workers
from servo.study.store import GOES_ON, Store, StudyFile, opened
from sim.camera import gl
from tracking.drawing.figures import save
from tracking.files import atomic
from tracking.files.json_text import json_text
from tracking.statistics.verdicts import Finding

TONES = {Finding.HOLDS: "green", Finding.DOES_NOT_HOLD: "red", Finding.UNDECIDED: "yellow"}


def run(
    claims: Sequence[str],
    quick: bool,
    sequences: Path | None,
    first_seed: int | None,
    workers: int,
    out: Path | None,
    dry_run: bool,
    quiet: bool,
) -> int:
    """Test claims of the three papers again, and print and write the verdicts.

    Args:
        claims: Names of the claims, such as "P1-2"; none: all but those about the tuning of
            trackers.
        quick: Whether to run one seed of each claim only, as a check that all works.
        sequences: A folder of real sequences to add to those of the claims `JOINED`; None: none.
        first_seed: The first seed; None: the seeds that the rules name.
        workers: Number of processes.
        out: The folder to write; None: runs/papers, runs/papers-quick for a quick run, or
            runs/papers-SEED for another first seed.
        dry_run: Whether to print only how many runs there are and how long they take.
        quiet: Whether to print on stderr only: mistakes, failed runs and changed verdicts.

    Returns:
        The exit code: 1 if a run failed, or if a full run on the seeds that the claims' rules name
        found another verdict than the published one, else 0.

    Raises:
        Mistake: There is no such claim, none of the claims uses the given sequences, the folder
            cannot be used, or a first seed is given that was used for tuning, for a quick run, or
            for a claim that has seeds of its own.
        Refused: A file cannot be written, or the workers cannot work.
    """
    effort = Effort(quick, sequences, first_seed)
    chosen = _chosen(claims, effort)
    with as_mistake():
        jobs = {claim.name: claim.jobs(effort) for claim in chosen}
    usual = "papers-quick" if quick else "papers"
    folder = out or Path("runs") / (f"papers-{first_seed}" if first_seed else usual)
    options = {"quick": quick, "sequences": sequences, "first_seed": first_seed}
    again = command_line("papers", *claims, **options)
    console = Console(quiet=quiet)
    every = {job.key: job for some in jobs.values() for job in some}
    verdicts: dict[str, Verdict] = {}
    if any(isinstance(job.subject, EstimatedLoop) for job in every.values()):
        gl.is_there()  # it says in one sentence where this machine has none
    if dry_run:
        return print_estimate(list(every.values()), workers, console, Store(folder))
    # The folder is described in the same way for all claims, which share runs.
    described = StudyFile(
        command=again,
        versions=versions(),
        holds="papers",
        name="papers",
        title="Claims of the three papers, tested again.",
        axes={},
        draws={},
        seeds=[],
        compare=None,
        expect={},
        runs=0,
        table={},
        scenarios={},
    )
    with Workers(workers) as pool, opened(folder, described) as store:
        plain(console, f"claims: {len(chosen)}, runs: {len(every)}")
        for claim in chosen:
            _print_rule(console, claim)
            store.find(jobs[claim.name])
            if complete_jobs(jobs[claim.name], store, pool, console, claim.name, GOES_ON):
                continue
            verdict = claim.judge(Evidence(store.records(jobs[claim.name]), effort, folder))
            if verdict.figure is not None:
                save(verdict.figure, atomic.folder(folder, FIGURES), f"{claim.name}.png")
            verdicts[claim.name] = verdict
            _print(console, verdict)
        tested = {c.name: Judged.of(c, verdicts[c.name]) for c in chosen if c.name in verdicts}
        written = PapersReport(
            command=again,
            versions=versions(),
            quick=quick,
            first_seed=first_seed,
            claims=tested,
        ).write(folder)
        found = found_in(verdicts)
        atomic.write(folder, VERDICTS, json_text(found))
    plain(console, f"\n| {' | '.join(TITLES)} |\n|{'---|' * len(TITLES)}")
    plain(console, *(judged.row(name) for name, judged in tested.items()))
    print_paths(console, [folder / FIGURES, written])
    if first_seed is not None:
        _print_beside(console, found, first_seed)
        return 1 if len(verdicts) < len(chosen) else 0
    others = [] if quick else [f"papers: {one}" for one in broken(found, known())]
    complain(*others)
    return 1 if others or len(verdicts) < len(chosen) else 0


def _chosen(names: Sequence[str], effort: Effort) -> list[Claim]:
    """Return the claims of these names, or without a name all but those about tuning. If
    `effort.first` is given, their rules name the seeds from it on.

    Raises:
        Mistake: There is no such claim, none of the claims uses the given sequences, or the claims
            cannot be tested on seeds from `effort.first` on.
    """
    there = {claim.name: claim for claim in (*CLAIMS, *TUNING)}
    check_known(names, there, "papers", "claim")
    chosen = [there[name] for name in names] if names else list(CLAIMS)
    if effort.sequences is not None and not any(claim.name in JOINED for claim in chosen):
        raise Mistake(
            f"papers: --sequences is only for the claims {', '.join(JOINED)}: name one of them, too"
        )
    if effort.first is not None:
        _check_first(effort, effort.first, chosen)
        return [replace(claim, rule=claim.rule.on(effort.first)) for claim in chosen]
    return chosen


def _check_first(effort: Effort, first: int, chosen: Sequence[Claim]) -> None:
    """Check that the claims can be tested on seeds from `first` on.

    Raises:
        Mistake: These seeds were used for tuning, a claim is about tuning, or --quick is given.
    """
    if effort.quick:
        raise Mistake("papers: --quick has its own seed: leave out --first-seed or --quick")
    if first < FRESH:
        raise Mistake(
            f"papers: --first-seed {first}: the settings were tuned on seeds below {FRESH}; give "
            f"{FRESH} or more"
        )
    tuning = [claim.name for claim in chosen if claim in TUNING]
    if tuning:
        raise Mistake(
            f"papers: {tuning[0]} has its own seeds: leave out --first-seed or {tuning[0]}"
        )


def _print_beside(console: Console, found: Found, first: int) -> None:
    """Print a table of the verdicts on the seeds from `first` on, beside the published verdicts on
    the seeds that the claims' rules name.
    """
    plain(console, f"  verdicts on seeds from {first} on, beside those on the registered seeds:")
    before = known()
    rows = [[name, *new, *before.get(name, ("-", "-"))] for name, new in found.items()]
    head = ("claim", "verdict", "effect", "registered", "effect, registered")
    print_table(console, Table(head, rows, words=range(len(head))))


def _print_rule(console: Console, claim: Claim) -> None:
    """Print a claim and the rule by which its runs will be judged."""
    console.print(f"\n[bold]{claim.name}[/] {escape(claim.says)}", highlight=False)
    for name, text in asdict(claim.rule).items():
        plain(console, f"  {name + ':':9} {text}")


def _print(console: Console, verdict: Verdict) -> None:
    word = f"[{TONES[verdict.finding]}]{WORDS[verdict.finding]}[/]"
    effect = escape(f"{words(verdict.effect, verdict.unit)}, {verdict.count} units")
    console.print(f"  verdict:  {word}: {effect}", highlight=False)
    plain(console, f"  measured: {verdict.measured}")
    if verdict.table:
        head, *rows = verdict.table
        print_table(console, Table(head, rows, words=range(len(head))))
