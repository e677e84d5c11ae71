"""The command `servobench check`: test scenarios against their bounds, also for other programs."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path
from typing import Any, ClassVar
from xml.etree import ElementTree

from rich.console import Console

from servo.cli.jobs import print_estimate, progress
from servo.cli.run_command import load, measures_lines, print_missed
from servo.cli.terminal import complain, plain, print_table
from servo.loop.measure import MEASURES
from servo.mistake import Mistake, Refused, check_suffix, one_line, writing
from servo.output.formats import Made, command_line
from servo.output.versions import versions
from servo.report.words import Badge, Cell, Table
from servo.scenario import catalogue
from servo.scenario import load as scenarios
from servo.scenario.load import Scenario
from servo.scenario.toml import assignment
from servo.study.bounds import DrawnShare, unjudged
from servo.study.execute import Workers, check_number, execute
from servo.study.run import ClusterLost, Failure, Job, Record
from servo.study.scenario_run import LoadedScenario
from sim.camera import gl
from tracking.files import atomic
from tracking.files.json_text import number

End = tuple[Job, Record | Failure]
NO_BOUNDS = "No verdict: this scenario has no bounds."
UNFINISHED = "the check was stopped before this run ended"
TITLES = ("scenario", "seed", "outcome", "rms px", "peak", "tracker", "bounds", "time")


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckFile(Made):
    """The file of --json."""

    FILE: ClassVar[str] = "check.json"
    KIND: ClassVar[str] = "check"

    runs: list[dict[str, Any]]
    """One for each run: scenario, seed, the command that repeats it, seconds of wall-clock time,
    outcome, measures, the bounds that were missed, in `failed` why there is no outcome, and in
    `unjudged` why there is no verdict."""
    shares: list[DrawnShare] = field(default_factory=list[DrawnShare])
    """How many drawn seeds ended as expected, of each scenario where some may end otherwise."""


def _described(job: Job, end: Record | Failure) -> dict[str, Any]:
    failed = isinstance(end, Failure)
    found = {} if failed else end.measures
    return {
        "scenario": job.subject.name,
        "seed": job.seed,
        "command": job.command,
        "seconds": 0.0 if failed else end.seconds,
        "outcome": "" if failed else end.outcome,
        "measures": {name: number(found[name]) for name in MEASURES if name in found},
        "missed": [] if failed else list(end.missed),
        "failed": end.reason if failed else "",
        "unjudged": "" if failed else _unjudged(_scenario(job), end),
    }


def _unjudged(scenario: Scenario, record: Record) -> str:
    """Return why a run has no verdict; nothing where it has one."""
    return unjudged(scenario, record.success) or NO_BOUNDS * (not scenario.expect)


def check_scenarios(
    names: Sequence[str],
    changes: Sequence[str],
    seed: int,
    count: int,
    workers: int,
    quiet: bool,
    dry_run: bool = False,
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
    _check_place(junit, ".xml")
    _check_place(json, ".json")
    console = Console(quiet=quiet)
    each = [(name, s) for name in chosen for s in range(seed, seed + count)]
    jobs: list[Job] = []
    with progress(console, "check: reading scenarios", len(each)) as ended:
        for name, s in each:
            again = command_line("run", name, set=list(changes), seed=s)
            try:
                scenario = load(name, changes, s)
            except Mistake as mistake:
                refused = [_refused(name, s, again, mistake)]
                _write(refused, junit, json, command_line("check", *names, set=list(changes)))
                raise
            jobs.append(Job(len(jobs), LoadedScenario(scenario), s, command=again))
            ended(name)
    gl.is_there()
    if dry_run:
        return print_estimate(jobs, workers, console)
    if len(jobs) > 1:
        plain(console, f"check: {len(jobs):,} runs")
    again = command_line("check", *names, set=list(changes), seed=seed, seeds=count)
    done: dict[int, End] = {}
    try:
        _carry_out(jobs, workers, console, done)
    except KeyboardInterrupt:
        _write([_described(*done.get(j.number, _stopped(j))) for j in jobs], junit, json, again)
        raise
    ends = [done[job.number] for job in jobs]
    records = [(job, end) for job, end in ends if isinstance(end, Record)]
    shares = _shares(records, count)
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


def _print_short(errors: Console, jobs: Sequence[Job]) -> None:
    """Say which scenarios end before their errors count, or have bounds that judge nothing."""
    found = {job.subject.name: measures_lines(_scenario(job)) for job in jobs}
    for name, lines in found.items():
        for line in lines:
            plain(errors, f"{name}: {line}")


def _print_unjudged(errors: Console, records: Sequence[tuple[Job, Record]], count: int) -> None:
    """Say how many of `count` runs have no verdict because there are no bounds for them."""
    without = [job for job, _ in records if not _scenario(job).expect]
    if without:
        names = ", ".join(dict.fromkeys(job.subject.name for job in without))
        why = _scenario(without[0]).unjudged or NO_BOUNDS
        plain(errors, f"{len(without)} of {count} runs ({names}): {why}")


def _shares(records: Sequence[tuple[Job, Record]], count: int) -> list[DrawnShare]:
    """Return the shares of drawn seeds that are judged; each scenario has `count` runs."""
    shares: list[DrawnShare | None] = []
    for _, runs in groupby(records, lambda run: run[0].number // count):
        shares.append(DrawnShare.of([(_scenario(job), end.success) for job, end in runs]))
    return [share for share in shares if share is not None]


def _scenario(job: Job) -> Scenario:
    assert isinstance(job.subject, LoadedScenario)
    return job.subject.scenario


def _refused(name: str, seed: int, command: str, mistake: Mistake) -> dict[str, Any]:
    """Return what stands in the files for a scenario that cannot be read: no run began."""
    run = {"scenario": name, "seed": seed, "command": command, "seconds": 0.0, "outcome": ""}
    return run | {"measures": {}, "missed": [], "failed": str(mistake), "unjudged": ""}


def _write(
    runs: list[dict[str, Any]],
    junit: Path | None,
    json: Path | None,
    command: str,
    shares: Sequence[DrawnShare] = (),
) -> None:
    found = CheckFile(command=command, versions=versions(), runs=runs, shares=list(shares))
    texts = {
        junit: _junit(runs, shares, command),
        json: found.text(),
    }
    for path, text in texts.items():
        if path is not None:
            with writing(path, "this file"):
                atomic.write(path.absolute().parent, path.name, text)


def _check_changes(changes: Sequence[str]) -> None:
    """Refuse a change of the seed, which --seed and --seeds set."""
    for item in changes:
        key, value = assignment(item)
        if key == "run.seed" or (key == "run" and isinstance(value, dict) and "seed" in value):
            raise Mistake(f"--set {item}: a check gives the seeds; use --seed and --seeds")


def _stopped(job: Job) -> End:
    return job, Failure(UNFINISHED)


def _carry_out(jobs: Sequence[Job], workers: int, console: Console, ends: dict[int, End]) -> None:
    """Do all runs, and put how each ended under its job's number."""
    pool = Workers(min(workers, len(jobs)))
    with pool, progress(console, "check", len(jobs)) as ended:
        try:
            for job, end in execute(jobs, pool):
                ends[job.number] = job, end
                ended(f"{job.subject.name}, seed {job.seed}")
        except ClusterLost as error:
            raise Refused(f"{error}; the check has no result") from None


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
    return Table(TITLES, cells, words=(0, 2, 6))


def _check_place(path: Path | None, suffix: str) -> None:
    """Refuse a file that cannot be written, or that may be the user's own, before the runs.

    Raises:
        Mistake: Its folder is missing, it is a folder, a device or a link, or has another suffix.
    """
    if path is None:
        return
    check_suffix(path, suffix)
    other = path.is_symlink() or (path.exists() and not path.is_file())
    if other or not path.absolute().parent.is_dir():
        raise Mistake(f"{path}: this should be a file to write, in a folder that is there")


def _junit(runs: list[dict[str, Any]], shares: Sequence[DrawnShare], command: str) -> str:
    """A test case for each run and share: what was missed, and the command that repeats it."""
    tests = str(len(runs) + len(shares))
    suite = ElementTree.Element("testsuite", name="servobench check", tests=tests)
    for run in runs:
        case = ElementTree.SubElement(
            suite,
            "testcase",
            classname=f"servobench.{one_line(run['scenario'])}",
            name=one_line(f"{run['scenario']}, seed {run['seed']}"),
            time=f"{run['seconds']:.3f}",
        )
        message = run["failed"] or "; ".join(map(str, run["missed"]))
        if run["unjudged"]:
            ElementTree.SubElement(case, "skipped", message=one_line(run["unjudged"]))
        elif message:
            tag = "error" if run["failed"] else "failure"
            found = ElementTree.SubElement(case, tag, message=one_line(message))
            found.text = one_line(f"again: {run['command']}")
    for share in shares:
        name = one_line(share.scenario)
        case = ElementTree.SubElement(
            suite, "testcase", classname=f"servobench.{name}", name=f"{name}, drawn seeds"
        )
        if share.missed:
            found = ElementTree.SubElement(case, "failure", message=one_line(str(share)))
            found.text = one_line(f"again: {command}")
    for plural, tag in (("failures", "failure"), ("errors", "error"), ("skipped", "skipped")):
        suite.set(plural, str(len(suite.findall(f"testcase/{tag}"))))
    suite.set("time", f"{sum(run['seconds'] for run in runs):.3f}")
    ElementTree.indent(suite)
    return ElementTree.tostring(suite, encoding="unicode", xml_declaration=True) + "\n"
