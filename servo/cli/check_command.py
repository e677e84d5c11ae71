"""The command `servobench check`: test scenarios against their bounds."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape

from servo.batch.workers import Ended, Workers, check_number
from servo.cli import check_files
from servo.cli.check_files import CheckedRun, CheckFile
from servo.cli.run_command import load, print_missed
from servo.cli.terminal import complain, plain, print_table, progress_bar
from servo.loop.measured_run import measured_run
from servo.loop.run_measures import Report, Violation, violations
from servo.mistake import Mistake
from servo.output.formats import command_line
from servo.output.versions import versions
from servo.report.words import Badge, Cell, Table
from servo.scenario import catalogue
from servo.scenario import load as scenarios
from servo.scenario.load import Scenario
from servo.scenario.toml import assignment
from sim.camera import gl
from tracking.files.json_text import number

TITLES = ("scenario", "seed", "outcome", "rms px", "peak", "tracker", "bounds", "time")


@dataclass(frozen=True, slots=True)
class Check:
    """One run to do; it is sent between processes."""

    number: int
    """Row of the table."""
    scenario: Scenario
    command: str
    """The command that repeats it."""


@dataclass(frozen=True, slots=True)
class Checked:
    """The result of a run."""

    report: Report
    missed: list[Violation]
    seconds: float


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
    checks = [
        Check(i, load(name, changes, s), command_line("run", name, set=list(changes), seed=s))
        for i, (name, s) in enumerate(each)
    ]
    gl.backend()
    console = Console(quiet=quiet)
    ends = _carry_out(checks, workers, console)
    again = command_line("check", *names, set=list(changes), seed=seed, seeds=count)
    _write(
        [_record(check, end) for check, end in zip(checks, ends, strict=True)], junit, json, again
    )
    rows = [(check, end.value) for check, end in zip(checks, ends, strict=True) if not end.error]
    if rows:
        print_table(console, _table(rows))
    errors = Console(stderr=True)
    for check, checked in rows:
        print_missed(errors, checked.missed, check.command)
    return max(_print_failures(checks, ends), any(checked.missed for _, checked in rows))


def _record(check: Check, end: Ended) -> CheckedRun:
    scenario = check.scenario
    value = end.value
    of: Any = {"scenario": scenario.name, "seed": scenario.run.seed, "command": check.command}
    if end.error:
        return CheckedRun(**of, measures={}, missed=[], failed=end.reason)
    measures = {m.name: number(m.value) for m in value.report.measures}
    return CheckedRun(
        **of,
        seconds=value.seconds,
        outcome=value.report.outcome.name,
        measures=measures,
        missed=value.missed,
    )


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


def perform(check: Check) -> Checked:
    """Run a scenario and measure it.

    Raises:
        Mistake: A setting is not valid.
    """
    began = time.perf_counter()
    _, report = measured_run(check.scenario)
    missed = violations(report, check.scenario.expect)
    return Checked(report, missed, time.perf_counter() - began)


def _carry_out(checks: Sequence[Check], workers: int, console: Console) -> list[Ended]:
    """Do all runs; how they ended, in the order of the table."""
    ends: dict[int, Ended] = {}
    with Workers(min(workers, len(checks))) as pool, progress_bar(console) as progress:
        task = progress.add_task("check", total=len(checks), note="")
        for check, ended in pool.ends(checks, perform):
            ends[check.number] = ended
            scenario = check.scenario
            note = f"{escape(scenario.name)}, seed {scenario.run.seed}"
            progress.update(task, advance=1, note=note)
    return [ends[check.number] for check in checks]


def _print_failures(checks: Sequence[Check], ends: Sequence[Ended]) -> int:
    """Print why runs failed, each mistake once; the exit code."""
    failed = [(check, end) for check, end in zip(checks, ends, strict=True) if end.error]
    mistakes: dict[str, list[Check]] = {}
    for check, end in failed:
        if end.mistake:
            mistakes.setdefault(end.mistake, []).append(check)
    for sentence, checks_of in mistakes.items():
        names = ", ".join(dict.fromkeys(check.scenario.name for check in checks_of))
        known = any(check.scenario.name in sentence for check in checks_of)
        complain(sentence if known else f"{sentence} ({names})")
    for check, end in failed:
        if not end.mistake:
            complain(f"{check.scenario.name} failed: {end.reason}")
            plain(Console(stderr=True), f"  again: {check.command}")
    return max((2 if end.mistake else 1 for _, end in failed), default=0)


def _table(rows: Sequence[tuple[Check, Checked]]) -> Table:
    cells: list[list[Cell]] = []
    for check, checked in rows:
        scenario = check.scenario
        value = checked.report.value
        bounds = len(scenario.expect)
        missed = len(checked.missed)
        kept = Badge.of(not missed, f"{bounds - missed} of {bounds}")
        cells.append(
            [
                scenario.name,
                str(scenario.run.seed),
                checked.report.outcome.name,
                f"{value('servo_rms_px'):.2f}",
                f"{value('servo_peak_px'):.1f}",
                f"{value('tracking_rms_px'):.2f}",
                kept if bounds else "none",
                f"{checked.seconds:.1f} s",
            ]
        )
    return Table(TITLES, cells, words=(0, 2, 6))
