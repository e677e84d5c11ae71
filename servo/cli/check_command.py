"""The command `servobench check`: test scenarios against their bounds."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.markup import escape

from servo.cli import check_files
from servo.cli.check_files import CheckedRun, CheckFile
from servo.cli.run_command import load, print_missed
from servo.cli.terminal import complain, plain, print_table, progress_bar
from servo.mistake import Mistake, Refused
from servo.output.formats import command_line
from servo.output.versions import versions
from servo.report.words import Badge, Cell, Table
from servo.scenario import catalogue
from servo.scenario import load as scenarios
from servo.scenario.toml import assignment
from servo.study.execute import Workers, check_number, execute
from servo.study.failure import ClusterLost, Failure
from servo.study.job import Job
from servo.study.record import Record
from servo.study.scenario_run import LoadedScenario
from sim.camera import gl

End = tuple[Job, Record | Failure]
TITLES = ("scenario", "seed", "outcome", "rms px", "peak", "tracker", "bounds", "time")


def check_scenarios(
    names: Sequence[str],
    changes: Sequence[str],
    seed: int,
    count: int,
    workers: int,
    quiet: bool,
    junit: Path | None = None,
    json: Path | None = None,
) -> int:
    """Run scenarios, each with `count` seeds from `seed` on, and print which bounds they keep; also
    into files, as JUnit's XML and as JSON.

    Returns:
        The exit code: 1 if a bound was missed or a run failed, 2 if a run failed because of the
        user's mistake.
    """
    chosen = list(names) or [n for n in catalogue.shipped() if scenarios.load(n).expect]
    check_number(len(chosen) * count)
    _check_changes(changes)
    check_files.check_place(junit, ".xml")
    check_files.check_place(json, ".json")
    each = [(name, s) for name in chosen for s in range(seed, seed + count)]
    jobs = [
        Job(
            i,
            LoadedScenario(load(name, changes, s)),
            s,
            command=command_line("run", name, set=list(changes), seed=s),
        )
        for i, (name, s) in enumerate(each)
    ]
    gl.backend()
    console = Console(quiet=quiet)
    ends = _carry_out(jobs, workers, console)
    again = command_line("check", *names, set=list(changes), seed=seed, seeds=count)
    _write([CheckedRun.of(*one) for one in ends], junit, json, again)
    records = [(job, end) for job, end in ends if isinstance(end, Record)]
    if records:
        print_table(console, _table(records))
    errors = Console(stderr=True)
    for _, record in records:
        print_missed(errors, record)
    return max(_print_failures(ends), any(record.missed for _, record in records))


def _write(runs: list[CheckedRun], junit: Path | None, json: Path | None, command: str) -> None:
    if junit is not None:
        check_files.write(junit, check_files.junit(runs))
    if json is not None:
        found = CheckFile(command=command, versions=versions(), runs=runs)
        check_files.write(json, found.text())


def _check_changes(changes: Sequence[str]) -> None:
    """Refuse a change of the seed, which --seed and --seeds set."""
    for item in changes:
        key, value = assignment(item)
        if key == "run.seed" or (key == "run" and isinstance(value, dict) and "seed" in value):
            raise Mistake(f"--set {item}: a check gives the seeds; use --seed and --seeds")


def _carry_out(jobs: Sequence[Job], workers: int, console: Console) -> list[End]:
    """Do all runs; how they ended, in the order of the table."""
    ends: dict[int, End] = {}
    pool = Workers(min(workers, len(jobs)))
    with pool, progress_bar(console) as progress:
        task = progress.add_task("check", total=len(jobs), note="")
        try:
            for job, end in execute(jobs, pool):
                ends[job.number] = job, end
                note = f"{escape(job.subject.name)}, seed {job.seed}"
                progress.update(task, advance=1, note=note)
        except ClusterLost as error:
            raise Refused(f"{error}; the check has no result") from None
    return [ends[job.number] for job in jobs]


def _print_failures(ends: Sequence[End]) -> int:
    """Print why runs failed, each mistake once; the exit code."""
    failed = [(job, end) for job, end in ends if isinstance(end, Failure)]
    mistakes: dict[str, list[str]] = {}
    for job, end in failed:
        if end.mistake:
            mistakes.setdefault(end.mistake, []).append(job.subject.name)
    for sentence, names in mistakes.items():
        known = any(name in sentence for name in names)
        complain(sentence if known else f"{sentence} ({', '.join(dict.fromkeys(names))})")
    for job, end in failed:
        if not end.mistake:
            complain(f"{job.subject.name} failed: {end.reason}")
            plain(Console(stderr=True), f"  again: {job.command}")
    return max((2 if end.mistake else 1 for _, end in failed), default=0)


def _table(records: Sequence[tuple[Job, Record]]) -> Table:
    cells: list[list[Cell]] = []
    for job, record in records:
        assert isinstance(job.subject, LoadedScenario)
        bounds = len(job.subject.scenario.expect)
        missed = len(record.missed)
        kept = Badge.of(not missed, f"{bounds - missed} of {bounds}")
        cells.append(
            [
                record.subject,
                str(record.seed),
                record.outcome,
                f"{record.measures['servo_rms_px']:.2f}",
                f"{record.measures['servo_peak_px']:.1f}",
                f"{record.measures['tracking_rms_px']:.2f}",
                kept if bounds else "none",
                f"{record.seconds:.1f} s",
            ]
        )
    return Table(TITLES, cells, words=(0, 2, 6))
