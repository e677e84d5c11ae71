"""The command `servobench benchmark`: contestants in a public benchmark, and their rows."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.console import Console

from servo.bench.audit import (
    Audit,
    Repeated,
    audit,
    errors_file,
    errors_text,
    read_errors,
    repeated,
    sample,
)
from servo.bench.benchmark import QUICK, Band, Benchmark, World, load
from servo.bench.contestant import Contestant, Division, contestants, home_of, scale_of
from servo.bench.row import Row, check_version, file_name, row_of, shipped_rows
from servo.bench.world_run import CONTESTANT, SLOW, WORLD, jobs_of
from servo.cli.jobs import complete_jobs, go_on, print_estimate, progress
from servo.cli.terminal import plain, print_table
from servo.mistake import Mistake, as_mistake, writing
from servo.output.formats import command_line
from servo.output.versions import versions
from servo.report import benchmark_section
from servo.scenario.load import Scenario
from servo.study.execute import Workers, check_number, execute
from servo.study.run import Failure, Record
from servo.study.store import Store, StudyFile, opened
from sim.camera import gl
from tracking.files import atomic
from tracking.files.json_text import as_json
from tracking.trackers import trax
from tracking.types import Region, State
from tracking.wrapped.trax_client import TraxClient


@dataclass(frozen=True, slots=True)
class BenchmarkRequest:
    """The options of the command line."""

    name: str
    given: Sequence[str]
    """Contestants."""
    changes: Sequence[str]
    band: str | None
    sealed: str | None
    quick: bool
    submit: Path | None
    verify: Path | None
    workers: int
    out: Path | None
    quiet: bool
    dry_run: bool

    @property
    def folder(self) -> Path:
        """Where the results are written."""
        return self.out or Path("runs") / f"benchmark-{self.name}"

    @property
    def command(self) -> str:
        """The command line, without --out and --workers."""
        return command_line(
            "benchmark",
            self.name,
            contestant=list(self.given),
            set=list(self.changes),
            band=self.band,
            sealed=self.sealed,
            quick=self.quick,
        )


def run(request: BenchmarkRequest) -> int:
    """Run contestants in a benchmark, and write their rows; the exit code: 1 if a run failed.

    Raises:
        Mistake: A contestant is wrong, or the folder cannot be used.
        Refused: A file cannot be written, or the workers cannot work.
    """
    console = Console(quiet=request.quiet)
    benchmark = load(request.name)
    benchmark.check_frozen()
    chosen = contestants(benchmark, request.given, request.changes)
    gl.is_there()
    if request.verify is not None:
        given = chosen if request.given else None
        rng = np.random.default_rng()
        return _verify(benchmark, request.verify, given, request.workers, console, rng)
    band = _band(request, chosen)
    worlds = benchmark.every_world(band, QUICK if request.quick else None)
    for one in chosen:  # what is wrong with it is said before anything is run
        _try_out(benchmark.scenario_of(worlds[0], one.settings), console)
    known = _scale_rows(benchmark) if band.name == "v1" else []
    every = chosen if known else [*scale_of(benchmark), *chosen]
    jobs = jobs_of(benchmark, every, worlds)
    check_number(len(jobs))
    if request.dry_run:
        return print_estimate(jobs, request.workers, console, Store(request.folder))
    workers = Workers(request.workers)
    again = go_on(request.command, request.out)
    plain(console, f"{benchmark.name} {benchmark.hash}, worlds: {band.name}")
    with opened(request.folder, _described(request, benchmark, every, len(jobs))) as store, workers:
        store.find(jobs)
        title = f"benchmark {benchmark.name}"
        failed = complete_jobs(jobs, store, workers, console, title, again)
        records = store.records(jobs)
        rows = known + _rows(benchmark, band, every, worlds, records, request.command)
        _keep(store, rows)
        _print(console, benchmark, rows)
        if request.submit is not None and not failed:
            _submit(request.submit, rows[-1], records)
            plain(console, f"  {request.submit}")
        plain(console, f"for a page, run: servobench report {store.folder}")
    return 1 if failed else 0


def _try_out(scenario: Scenario, console: Console) -> None:
    """Show a guest's program a picture of noise, and end it: one that is silent or cannot begin
    would fail in every world, after its limit.

    Raises:
        Mistake: It does not speak TraX, or cannot begin.
    """
    guest = scenario.tracker
    if isinstance(guest, trax.Config):
        plain(console, f"'{guest.command}' has {guest.timeout:g} s to say hello")
        noise = np.random.default_rng(0).integers(0, 256, (240, 320, 3), np.uint8)
        with as_mistake():
            client = TraxClient(guest.command, guest.timeout)
            client.start(noise, Region(80.0, 60.0), State(160.0, 120.0))


def _band(request: BenchmarkRequest, chosen: Sequence[Contestant]) -> Band:
    """Return the worlds that are asked for.

    Raises:
        Mistake: There are several contestants where only one may be.
    """
    several = len(chosen) != 1
    if request.submit is not None and several:
        raise Mistake("--submit takes the row of one contestant: name one with --contestant")
    if request.sealed is None:
        return Band("v1" if request.band == "v1" else "dev")
    if several:
        raise Mistake("sealed worlds are drawn for one contestant: name one with --contestant")
    if chosen[0].is_unknown:
        raise Mistake(
            f"sealed worlds follow from the code of '{chosen[0].name}', and none was found: name "
            "its file or its module"
        )
    return Band("sealed", request.sealed, chosen[0].digest)


def _keep(store: Store, rows: Sequence[Row]) -> None:
    """Write the rows, and the table of all runs."""
    atomic.folder(store.folder, benchmark_section.ROWS)
    for row in rows:
        name = f"{benchmark_section.ROWS}/{file_name(row.contestant)}"
        store.write(name, row.text().encode())
    if store.done:
        store.export(store.table())


def _scale_rows(benchmark: Benchmark) -> list[Row]:
    """Return the shipped rows of the contestants that fix the scale; none unless all are there."""
    names = {one.name for one in scale_of(benchmark)}
    rows = [row for row in shipped_rows(benchmark) if row.contestant in names]
    return rows if len(rows) == len(names) else []


def _rows(
    benchmark: Benchmark,
    band: Band,
    chosen: Sequence[Contestant],
    worlds: Sequence[World],
    records: Sequence[Record],
    command: str,
) -> list[Row]:
    """Return the rows of the contestants that have a record of each world."""
    keys = {world.key for world in worlds}
    found = list[Row]()
    for one in chosen:
        own = [r for r in records if r.settings[CONTESTANT] == one.name]
        if {r.settings[WORLD] for r in own} == keys:
            found.append(row_of(benchmark, band, one, own, command))
    return found


def _print(console: Console, benchmark: Benchmark, rows: Sequence[Row]) -> None:
    if len(rows) > len(scale_of(benchmark)):
        every = benchmark_section.beside_published(benchmark, rows)
        for of in benchmark_section.by_pictures(benchmark, every).values():
            print_table(console, benchmark_section.standings_table(benchmark, of))
            if sentence := benchmark_section.difficulty_of(of):
                plain(console, sentence)
    here = {row.rendering for row in rows if row.rendering}
    if benchmark_section.is_whole(benchmark, rows) and here - {benchmark.rendering}:
        plain(
            console,
            "the pictures differ from the frozen ones: these rows stand in a table of their own",
        )


def _submit(file: Path, row: Row, records: Sequence[Record]) -> None:
    """Write a row, and beside it the errors of each picture as Parquet."""
    own = [r for r in records if r.settings[CONTESTANT] == row.contestant]
    with writing(file, "this row"):
        atomic.write(file.parent, file.name, row.text())
        atomic.write(file.parent, errors_file(file).name, errors_text(own))


def _verify(
    benchmark: Benchmark,
    file: Path,
    given: Sequence[Contestant] | None,
    count: int,
    console: Console,
    rng: np.random.Generator,
) -> int:
    """Audit a row, and repeat a tenth of its worlds; the exit code: 1 if something is wrong.

    Args:
        benchmark: Which the row should be of.
        file: The row.
        given: Contestants of the command line, if any.
        count: Number of workers.
        console: Where the findings are printed.
        rng: Draws the worlds.

    Raises:
        Mistake: The file is no row of this version, a guest's command is not given again, or a run
            failed.
    """
    row = Row.read(file)
    check_version(benchmark, row)
    one = _contestant(benchmark, row, given)
    beside = errors_file(file)
    errors = read_errors(beside) if beside.exists() else None
    found = audit(benchmark, row, one, errors)
    worlds = [world for world in sample(found.worlds, rng) if world.key in row.worlds]
    jobs = jobs_of(benchmark, [one], worlds)
    if errors is None:
        jobs = [job for job in jobs if job.settings[SLOW] == 0.0]
    runs = list[Repeated]()
    with Workers(count) as workers, progress(console, f"verify {file.name}", len(jobs)) as ended:
        for job, record in execute(jobs, workers):
            if isinstance(record, Failure):
                raise Mistake(f"{job.settings[WORLD]}: {record.reason}")
            runs.append(repeated(benchmark, row, errors, record))
            ended(str(job.settings[WORLD]))
    return _print_audit(console, row, found, runs)


def _print_audit(console: Console, row: Row, found: Audit, runs: Sequence[Repeated]) -> int:
    """Print what was found; the exit code."""
    every = {run.world for run in runs}
    differing = {run.world for run in runs if not run.agrees}
    rounded = {run.world for run in runs if run.agrees and not run.exactly} - differing
    agree = len(every) - len(differing) - len(rounded)
    plain(console, f"{row.contestant}: {agree} of {len(every)} worlds agree, bit for bit")
    if rounded:
        plain(console, f"  {len(rounded)} more agree but for the rounding of another processor")
    for key in sorted(differing):
        plain(console, f"  {key} differs")
    for sentence in found.faults:
        plain(console, f"  wrong: {sentence}")
    for sentence in found.remarks:
        plain(console, f"  note: {sentence}")
    return 1 if differing or found.faults else 0


def _contestant(benchmark: Benchmark, row: Row, given: Sequence[Contestant] | None) -> Contestant:
    """Return the contestant of a row: a shipped one by name; nothing that a file names is run."""
    if given is not None:
        return given[0]
    ours = {one.name: one for one in (*home_of(benchmark), *scale_of(benchmark))}
    if row.division not in (Division.HOME.name, Division.SCALE.name) or row.contestant not in ours:
        raise Mistake(
            f"'{row.contestant}' is not shipped: give it again with --contestant, as its command "
            f"does: {row.command}"
        )
    return ours[row.contestant]


def _described(
    request: BenchmarkRequest, benchmark: Benchmark, every: Sequence[Contestant], runs: int
) -> StudyFile:
    return StudyFile(
        command=request.command,
        versions=versions(),
        holds="benchmark",
        name=benchmark.name,
        title=benchmark.title,
        axes={CONTESTANT: [one.name for one in every]},
        draws={},
        seeds=[0],
        compare=CONTESTANT,
        expect={},
        runs=runs,
        table={
            "hash": benchmark.hash,
            "band": request.band,
            "sealed": request.sealed,
            "quick": request.quick,
            "contestants": {one.name: as_json(one.settings) for one in every},
            "digests": {one.name: one.digest for one in every},
        },
        scenarios={},
    )
