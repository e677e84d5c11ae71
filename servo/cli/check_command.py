"""The command `servobench check`: run scenarios, compare their measures with their bounds, and
write the results as JSON or JUnit files for other programs.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path
from typing import Any, ClassVar
from xml.etree import ElementTree

from rich.console import Console

from servo.cli.jobs import print_estimate, progress
from servo.cli.outputs import check_place
from servo.cli.run_command import load, measures_lines, print_missed
from servo.cli.terminal import complain, plain, print_table
from servo.loop.measure import MEASURES
from servo.mistake import Mistake, Refused, one_line, writing
from servo.output.formats import Made, command_line
from servo.output.versions import versions
from servo.report.words import Badge, Cell, Table
from servo.scenario import catalogue
from servo.scenario.load import Scenario
from servo.scenario.load import load as load_scenario
from servo.scenario.toml import assignment
from servo.study.bounds import DrawnShare, unjudged
from servo.study.execute import Workers, check_number, execute
from servo.study.run import ClusterLost, Failure, Job, Record
from servo.study.scenario_run import LoadedScenario
from sim.camera import gl
from tracking.files import atomic
from tracking.files.json_text import number

End = tuple[Job, Record | Failure]
Entry = dict[str, Any]
"""A run in the files of --json and --junit."""
NO_BOUNDS = "No verdict: this scenario has no bounds."


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckFile(Made):
    """The JSON file that `servobench check --json` writes: the results of all runs, and the share
    of runs with drawn settings that ended as expected, for each scenario with a bound on it.
    """

    FILE: ClassVar[str] = "check.json"
    KIND: ClassVar[str] = "check"

    runs: list[Entry]
    """An entry for each run: scenario, seed, the command that repeats it, wall-clock time in
    seconds, outcome, measures, missed bounds, the reason why it has no outcome (`failed`) and the
    reason why it has no verdict (`unjudged`)."""
    shares: list[DrawnShare] = field(default_factory=list[DrawnShare])
    """How many runs with drawn settings ended as expected, for each scenario with a bound on their
    share (expect.drawn.success_rate)."""


def _described(job: Job, end: Record | Failure) -> Entry:
    """Return the entry of a run for --json and --junit: outcome, measures and missed bounds, or the
    reason why the run failed.
    """
    name = job.subject.name
    if isinstance(end, Failure):
        return _entry(name, job.seed, job.command, end.reason)
    scenario = _scenario(job)
    return _entry(name, job.seed, job.command) | {
        "seconds": end.seconds,
        "outcome": end.outcome,
        "measures": {m: number(end.measures[m]) for m in MEASURES if m in end.measures},
        "missed": list(end.missed),
        "unjudged": unjudged(scenario, end.success) or NO_BOUNDS * (not scenario.expect),
    }


def _entry(name: str, seed: int, command: str, failed: str = "") -> Entry:
    """Return the entry of a run that has no result, for --json and --junit; `failed` is the reason,
    `command` repeats the run.
    """
    run = {"scenario": name, "seed": seed, "command": command, "seconds": 0.0, "outcome": ""}
    return run | {"measures": {}, "missed": [], "failed": failed, "unjudged": ""}


def run(
    scenarios: Sequence[str],
    changes: Sequence[str],
    seed: int,
    seeds: int,
    workers: int,
    quiet: bool,
    dry_run: bool = False,
    junit: Path | None = None,
    json: Path | None = None,
) -> int:
    """Run scenarios, print a table of their outcomes and main measures and the bounds that they
    miss, and write the results as files if asked to. The files are also written if a scenario is
    wrong (with its mistake alone), or if a signal stops the check (unfinished runs count as
    failed).

    Args:
        scenarios: Shipped scenarios or TOML files; none: all shipped ones with bounds.
        changes: Changes of settings, such as "run.duration=5".
        seed: The first seed of each scenario.
        seeds: Number of seeds of each scenario.
        workers: Number of processes.
        quiet: Whether to print only mistakes, failed runs, missed bounds, and why measures or
            verdicts are missing.
        dry_run: Whether to print only how many runs there are and how long they take.
        junit: An .xml file to write for JUnit; None: no such file.
        json: A .json file to write with all measures; None: no such file.

    Returns:
        The exit code: 1 if a bound was missed or a run failed, 2 if a run failed because of the
        user's mistake, else 0.

    Raises:
        Mistake: A scenario, a change or an option is wrong, or a file cannot be written.
        Refused: The workers cannot work, or the disk is full.
        KeyboardInterrupt: A signal stopped the check.
    """
    chosen = list(scenarios) or [n for n in catalogue.shipped() if load_scenario(n).expect]
    check_number(len(chosen) * seeds)
    _check_changes(changes)
    check_place(junit, ".xml")
    check_place(json, ".json")
    console = Console(quiet=quiet)
    each = [(name, s) for name in chosen for s in range(seed, seed + seeds)]
    jobs: list[Job] = []
    with progress(console, "check: reading scenarios", len(each)) as ended:
        for name, s in each:
            again = command_line("run", name, set=list(changes), seed=s)
            try:
                scenario = load(name, changes, s)
            except Mistake as mistake:
                refused = _entry(name, s, again, str(mistake))
                _write([refused], junit, json, command_line("check", *scenarios, set=list(changes)))
                raise
            jobs.append(Job(len(jobs), LoadedScenario(scenario), s, command=again))
            ended(name)
    gl.is_there()
    if dry_run:
        return print_estimate(jobs, workers, console)
    if len(jobs) > 1:
        plain(console, f"check: {len(jobs):,} runs")
    again = command_line("check", *scenarios, set=list(changes), seed=seed, seeds=seeds)
    done: dict[int, End] = {}
    try:
        _carry_out(jobs, workers, console, done)
    except KeyboardInterrupt:
        unfinished = Failure("the check was stopped before this run ended")
        ends = [done.get(job.number, (job, unfinished)) for job in jobs]
        _write([_described(*end) for end in ends], junit, json, again)
        raise
    ends = [done[job.number] for job in jobs]
    records = [(job, end) for job, end in ends if isinstance(end, Record)]
    shares = _shares(records, seeds)
    _write([_described(*one) for one in ends], junit, json, again, shares)
    if records:
        print_table(console, _table(ends))
    errors = Console(stderr=True)
    for share in shares:
        plain(errors if share.missed else console, f"{'missed: ' * share.missed}{share}")
    for _, record in records:
        print_missed(errors, record)
    _print_short(errors, [job for job, _ in records])
    _print_unjudged(errors, records, len(ends))
    missed = any(record.missed for _, record in records) or any(s.missed for s in shares)
    return max(_print_failures(ends), missed)


def _check_changes(changes: Sequence[str]) -> None:
    """Check that no change sets run.seed, which --seed and --seeds set.

    Raises:
        Mistake: A change sets run.seed, or is not of the form KEY=VALUE.
    """
    for item in changes:
        key, value = assignment(item)
        if key == "run.seed" or (key == "run" and isinstance(value, dict) and "seed" in value):
            raise Mistake(
                f"--set {item}: check sets this key by --seed and --seeds: use these options"
            )


def _print_short(errors: Console, jobs: Sequence[Job]) -> None:
    """Print on stderr, by scenario, which measures have no value because the run is too short, and
    which bounds every run keeps or every run misses.
    """
    found = {job.subject.name: measures_lines(_scenario(job)) for job in jobs}
    plain(errors, *(f"{name}: {line}" for name, lines in found.items() for line in lines))


def _print_unjudged(errors: Console, records: Sequence[tuple[Job, Record]], count: int) -> None:
    """Print which runs have no verdict because their scenarios have no bounds; `count` is the
    number of all runs.
    """
    without = [job for job, _ in records if not _scenario(job).expect]
    if without:
        names = ", ".join(dict.fromkeys(job.subject.name for job in without))
        why = _scenario(without[0]).unjudged or NO_BOUNDS
        plain(errors, f"{len(without)} of {count} runs ({names}): {why}")


def _shares(records: Sequence[tuple[Job, Record]], count: int) -> list[DrawnShare]:
    """Return how many runs with drawn settings ended as expected, for each scenario with a bound on
    their share; each scenario has `count` jobs with consecutive numbers, some perhaps without a
    record.
    """
    groups = groupby(records, lambda run: run[0].number // count)
    judged = ([(_scenario(job), end.success) for job, end in runs] for _, runs in groups)
    return [share for share in map(DrawnShare.of, judged) if share is not None]


def _scenario(job: Job) -> Scenario:
    assert isinstance(job.subject, LoadedScenario)
    return job.subject.scenario


def _write(
    runs: list[Entry],
    junit: Path | None,
    json: Path | None,
    command: str,
    shares: Sequence[DrawnShare] = (),
) -> None:
    found = CheckFile(command=command, versions=versions(), runs=runs, shares=list(shares))
    texts = {junit: _junit(runs, shares, command), json: found.text()}
    for path, text in texts.items():
        if path is not None:
            with writing(path, "this file"):
                atomic.write(path.absolute().parent, path.name, text)


def _carry_out(jobs: Sequence[Job], workers: int, console: Console, ends: dict[int, End]) -> None:
    """Do all runs, and add each job with its record or failure to `ends`, by the job's number.

    Raises:
        Refused: The workers have stopped or cannot be started.
    """
    pool = Workers(min(workers, len(jobs)))
    with pool, progress(console, "check", len(jobs)) as ended:
        try:
            for job, end in execute(jobs, pool):
                ends[job.number] = job, end
                ended(f"{job.subject.name}, seed {job.seed}")
        except ClusterLost as error:
            raise Refused(
                f"{error}; the check was stopped without a result: run the check again"
            ) from None


def _print_failures(ends: Sequence[End]) -> int:
    """Print why runs failed, each mistake once; return the exit code: 2 for a mistake of the user,
    1 for another failure, such as full memory, 0 without one.
    """
    failed = [(job, end) for job, end in ends if isinstance(end, Failure)]
    for sentence in dict.fromkeys(end.mistake for _, end in failed if end.mistake):
        names = dict.fromkeys(job.subject.name for job, end in failed if end.mistake == sentence)
        known = any(name in sentence for name in names)
        complain(sentence if known else f"{sentence} ({', '.join(names)})")
    for job, end in failed:
        if not end.mistake:
            complain(f"{job.subject.name} failed: {end.reason}")
            plain(Console(stderr=True), f"  again: {job.command}")
    mistakes = (end.mistake and not end.full for _, end in failed)
    return max((2 if is_mistake else 1 for is_mistake in mistakes), default=0)


def _table(ends: Sequence[End]) -> Table:
    cells: list[list[Cell]] = []
    for job, record in ends:
        scenario = _scenario(job)
        if isinstance(record, Failure):
            failed = Badge.of(False, "failed")
            cells.append([job.subject.name, str(job.seed), failed, "", "", "", "", ""])
            continue
        bounds = len(scenario.expect)
        kept = f"{bounds - len(record.missed)} of {bounds}"
        verdict = Badge.of(not record.missed, kept) if bounds else "none"
        cells.append(
            [
                record.subject,
                str(record.seed),
                record.outcome,
                f"{record.measures['servo_rms_px']:.2f}",
                f"{record.measures['servo_peak_px']:.1f}",
                f"{record.measures['tracking_rms_px']:.2f}",
                "counted" if bounds and unjudged(scenario, record.success) else verdict,
                f"{record.seconds:.1f} s",
            ]
        )
    head = ("scenario", "seed", "outcome", "rms px", "peak", "tracker", "bounds", "time")
    return Table(head, cells, words=(0, 2, 6))


def _junit(runs: list[Entry], shares: Sequence[DrawnShare], command: str) -> str:
    """Return JUnit's XML: a test case for each run and for each scenario's share of drawn seeds,
    with the missed bounds and the command that repeats it.
    """
    of_shares = [_entry(s.scenario, 0, command) | {"missed": [s] * s.missed} for s in shares]
    names = [f"seed {run['seed']}" for run in runs] + ["drawn seeds"] * len(shares)
    suite = ElementTree.Element("testsuite", name="servobench check", tests=str(len(names)))
    for name, run in zip(names, runs + of_shares, strict=True):
        scenario = one_line(run["scenario"])
        described = {"classname": f"servobench.{scenario}", "name": f"{scenario}, {name}"}
        case = ElementTree.SubElement(suite, "testcase", described, time=f"{run['seconds']:.3f}")
        message = run["failed"] or "; ".join(map(str, run["missed"]))
        if run["unjudged"]:
            ElementTree.SubElement(case, "skipped", message=one_line(run["unjudged"]))
        elif message:
            tag = "error" if run["failed"] else "failure"
            fault = ElementTree.SubElement(case, tag, message=one_line(message))
            fault.text = one_line(f"again: {run['command']}")
    for plural, tag in (("failures", "failure"), ("errors", "error"), ("skipped", "skipped")):
        suite.set(plural, str(len(suite.findall(f"testcase/{tag}"))))
    suite.set("time", f"{sum(run['seconds'] for run in runs):.3f}")
    ElementTree.indent(suite)
    return ElementTree.tostring(suite, encoding="unicode", xml_declaration=True) + "\n"
