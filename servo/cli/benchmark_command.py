"""The command `servobench benchmark`: run trackers or control laws in a public benchmark, write the
results of each as a file to publish, and verify a published file.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from rich.console import Console

from servo.bench.audit import (
    WorldComparison,
    audit,
    compare_run,
    errors_file,
    errors_parquet,
    expected_worlds,
    read_errors,
    sample,
)
from servo.bench.benchmark import QUICK, Band, Benchmark, World, load
from servo.bench.contestant import Contestant, Division, contestants, home_of, scale_of
from servo.bench.row import Row, check_version, file_name, row_of, shipped_rows
from servo.bench.world_run import CONTESTANT, SLOW, WORLD, jobs_of
from servo.cli.jobs import complete_jobs, go_on, print_estimate, progress
from servo.cli.terminal import plain, print_table
from servo.cli.try_out import try_out
from servo.mistake import Mistake, Refused, writing
from servo.output.formats import command_line
from servo.output.versions import versions
from servo.report import benchmark_section
from servo.study.execute import Workers, check_number, execute
from servo.study.run import ClusterLost, Failure, Record
from servo.study.store import Store, StudyFile, opened
from sim.camera import gl
from sim.files.picture_name import SKIMAGE, packaged
from tracking.files import atomic
from tracking.files.json_text import as_json


def run(
    name: str,
    given: Sequence[str],
    changes: Sequence[str],
    band: str | None,
    sealed: str | None,
    quick: bool,
    submit: Path | None,
    verify: Path | None,
    workers: int,
    out: Path | None,
    quiet: bool,
    dry_run: bool,
) -> int:
    """Run contestants (trackers or control laws) in the worlds (drawn scenarios) of a public
    benchmark, and write a row for each contestant that finished in all worlds: a JSON file of its
    scores. Or verify a published row.

    Args:
        name: The benchmark, such as "loop-v1".
        given: The contestants as the command line has them, such as "kams" or "mine=module:Class";
            empty: all shipped ones.
        changes: Changes of settings of all contestants, such as "controller.gain=2".
        band: The set of worlds: "dev" to tune on (also None), or "v1" of the published table.
        sealed: A public value from which other worlds are drawn; None: those of the band.
        quick: Whether to run only two worlds of each condition.
        submit: A JSON file to write for the only contestant's row, with the errors in a Parquet
            file beside it; not written if a run failed. None: no such file.
        verify: The file of a row to verify in place of running the contestants; None: they are run.
        workers: Number of processes.
        out: The folder to write; None: runs/benchmark-NAME.
        quiet: Whether to print on stderr only: mistakes and failed runs.
        dry_run: Whether to print only how many runs there are and how long they take.

    Returns:
        The exit code: 1 if a run failed or a verified row is wrong, else 0.

    Raises:
        Mistake: A contestant or an option is wrong, a file is not a row of this version, a run of
            the verification failed, a setting of this version differs from the frozen benchmark, a
            picture of scikit-image is missing, or the folder cannot be used.
        Refused: A file cannot be written, or the workers cannot work.
    """
    console = Console(quiet=quiet)
    benchmark = load(name)
    benchmark.check_frozen()
    chosen = contestants(benchmark, given, changes)
    gl.is_there()
    if verify is not None:
        if dry_run:
            raise Mistake("--dry-run has no effect with --verify: leave one of them out")
        return _verify(
            benchmark, verify, chosen if given else None, workers, console, np.random.default_rng()
        )
    for option, value in (("--submit", submit), ("--sealed", sealed)):
        if value is not None and len(chosen) != 1:
            raise Mistake(
                f"{option} needs one contestant, and there are several: name one with --contestant"
            )
    of = _sealed(sealed, chosen[0]) if sealed is not None else Band("v1" if band == "v1" else "dev")
    worlds = benchmark.every_world(of, QUICK if quick else None)
    firsts = [benchmark.scenario_of(worlds[0], one.settings) for one in chosen]
    _check_pictures(worlds)
    try_out((part for first in firsts for part in (first.tracker, first.controller)), console)
    known = _scale_rows(benchmark) if of.name == "v1" else []
    every = chosen if known else [*chosen, *scale_of(benchmark)]
    jobs = jobs_of(benchmark, every, worlds)
    check_number(len(jobs))
    folder = out or Path("runs") / f"benchmark-{name}"
    if dry_run:
        # To be published before the value of sealed worlds is known.
        plain(console, *(f"{one.name}: digest {one.digest}" for one in chosen if given))
        return print_estimate(jobs, workers, console, Store(folder))
    command = command_line(
        "benchmark",
        name,
        contestant=list(given),
        set=list(changes),
        band=band,
        sealed=sealed,
        quick=quick,
    )
    described = StudyFile(
        command=command,
        versions=versions(),
        holds="benchmark",
        name=name,
        title=benchmark.title,
        axes={CONTESTANT: [one.name for one in every]},
        draws={},
        seeds=[0],
        compare=CONTESTANT,
        expect={},
        runs=len(jobs),
        table={
            "hash": benchmark.hash,
            "band": band,
            "sealed": sealed,
            "quick": quick,
            "contestants": {one.name: as_json(one.settings) for one in every},
            "code": {one.name: one.digest for one in every},
        },
        scenarios={},
    )
    names = ", ".join(one.name for one in every)
    plain(
        console,
        f"{name} {benchmark.hash}, worlds: {of.name}",
        f"{len(jobs):,} runs in {len(worlds)} worlds: {names}{_slowed(benchmark)}",
    )
    with Workers(workers) as pool, opened(folder, described) as store:
        store.find(jobs)
        failed = complete_jobs(jobs, store, pool, console, f"benchmark {name}", go_on(command, out))
        records = store.records(jobs)
        rows = known + _rows(benchmark, of, every, worlds, records, command)
        _keep(store, rows)
        _print(console, benchmark, rows)
        if submit is not None and not failed:
            _submit(submit, next(r for r in rows if r.contestant == chosen[0].name), records)
            plain(console, f"  {submit}")
        plain(console, f"for a page of results, run: servobench report {store.folder}")
    return 1 if failed else 0


def _check_pictures(worlds: Sequence[World]) -> None:
    """Check that the pictures of the package scikit-image that worlds show are there.

    Raises:
        Mistake: The package is not installed, or lacks a picture.
    """
    named = {
        value: key
        for world in worlds
        for key, value in world.settings.items()
        if isinstance(value, str) and value.startswith(SKIMAGE)
    }
    for value, key in named.items():
        try:
            packaged(value, key)
        except ValueError as error:
            raise Mistake(str(error)) from None


def _slowed(benchmark: Benchmark) -> str:
    """Return the end of a sentence, which says in which worlds trackers also run slowed down, and
    with which times for a picture; "" for a benchmark without such runs.
    """
    slow = benchmark.slow
    if slow is None:
        return ""
    times = ", ".join(f"{ms:g}" for ms in slow.values)
    return f"; in those of {slow.condition} also with {times} ms for a picture"


def _sealed(value: str, one: Contestant) -> Band:
    """Return the sealed set of worlds: they are drawn from a public value and the digest of one
    contestant's code, so that nobody could tune on them.

    Raises:
        Mistake: The code of the contestant was not found.
    """
    if one.is_unknown:
        raise Mistake(
            f"--sealed draws worlds from the code of '{one.name}', but this code was not "
            "found: name the contestant's file or module"
        )
    return Band("sealed", value, one.digest)


def _keep(store: Store, rows: Sequence[Row]) -> None:
    """Write the contestants' rows (JSON files) and, if a run is finished, the tables of all
    finished runs into the folder of a store.
    """
    atomic.folder(store.folder, benchmark_section.ROWS)
    for row in rows:
        store.write(f"{benchmark_section.ROWS}/{file_name(row.contestant)}", row.text().encode())
    if store.done:
        store.export(store.table())


def _scale_rows(benchmark: Benchmark) -> list[Row]:
    """Return the shipped rows of the reference contestants that fix the scale of the scores; an
    empty list unless all are there.
    """
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
    """Return a row of scores for each contestant that has a record of every world."""
    keys = {world.key for world in worlds}
    runs = ([r for r in records if r.settings[CONTESTANT] == one.name] for one in chosen)
    return [
        row_of(benchmark, band, one, own, command)
        for one, own in zip(chosen, runs, strict=True)
        if {r.settings[WORLD] for r in own} == keys
    ]


def _print(console: Console, benchmark: Benchmark, rows: Sequence[Row]) -> None:
    if len(rows) > len(scale_of(benchmark)):
        every = benchmark_section.beside_published(benchmark, rows)
        for group in benchmark_section.by_pictures(benchmark, every).values():
            for of in benchmark_section.by_division(group).values():
                print_table(console, benchmark_section.standings_table(benchmark, of))
                plain(console, benchmark_section.difficulty_of(of))
    others = {row.rendering for row in rows} - {"", benchmark.rendering}
    if others and benchmark_section.is_whole(benchmark, rows):
        plain(
            console,
            "this machine renders other pictures than the benchmark's frozen ones: its results are "
            "in a table of their own",
        )


def _submit(file: Path, row: Row, records: Sequence[Record]) -> None:
    """Write a contestant's row to a JSON file, and the errors of its runs in each picture to a
    Parquet file beside it.
    """
    own = [r for r in records if r.settings[CONTESTANT] == row.contestant]
    with writing(file, "this row"):
        atomic.write(file.parent, file.name, row.text())
        atomic.write(file.parent, errors_file(file).name, errors_parquet(own))


def _verify(
    benchmark: Benchmark,
    file: Path,
    given: Sequence[Contestant] | None,
    count: int,
    console: Console,
    rng: np.random.Generator,
) -> int:
    """Check a published row for contradictions, run a tenth of its worlds (at least ten) again, and
    print which results differ.

    Args:
        benchmark: The benchmark that the row should be of.
        file: The row's file.
        given: Contestants of the command line, of which the first is run; None: the shipped
            contestant of the row's name.
        count: Number of processes.
        console: The output of the command.
        rng: Generator that draws the worlds to run again.

    Returns:
        The exit code: 1 if a world differs or the row contradicts itself, else 0.

    Raises:
        Mistake: The file is not a row of this version, its Parquet file cannot be read, the
            contestant is neither shipped nor in `given`, or a run failed.
        Refused: The workers have stopped or cannot be started.
    """
    row = Row.read(file)
    check_version(benchmark, row)
    one = _contestant(benchmark, row, given)
    beside = errors_file(file)
    errors = read_errors(beside) if beside.exists() else None
    faults, remarks = audit(benchmark, row, one, errors)
    drawn = sample(expected_worlds(benchmark, row), rng)
    jobs = jobs_of(benchmark, [one], [world for world in drawn if world.key in row.worlds])
    if errors is None:
        jobs = [job for job in jobs if job.settings[SLOW] == 0.0]
    runs = list[WorldComparison]()
    with Workers(count) as workers, progress(console, f"verify {file.name}", len(jobs)) as ended:
        try:
            for job, record in execute(jobs, workers):
                if isinstance(record, Failure):
                    raise Mistake(f"{job.settings[WORLD]}: {record.reason}")
                runs.append(compare_run(benchmark, row, errors, record))
                ended(str(job.settings[WORLD]))
        except ClusterLost as lost:
            raise Refused(f"{lost}; the row is not verified: verify it again") from None
    every = {run.world for run in runs}
    differing = {run.world for run in runs if not run.agrees}
    rounded = {run.world for run in runs if run.agrees and not run.exactly} - differing
    agree = len(every) - len(differing) - len(rounded)
    plain(console, f"{row.contestant}: {agree} of {len(every)} repeated worlds agree, bit for bit")
    if rounded:
        plain(
            console, f"  {len(rounded)} more worlds agree except for rounding by another processor"
        )
    plain(console, *(f"  {key} differs" for key in sorted(differing)))
    plain(console, *(f"  wrong: {sentence}" for sentence in faults))
    plain(console, *(f"  note: {sentence}" for sentence in remarks))
    return 1 if differing or faults else 0


def _contestant(benchmark: Benchmark, row: Row, given: Sequence[Contestant] | None) -> Contestant:
    """Return the contestant to repeat the runs of a row with: the first one of the command line, or
    else the shipped one of the row's name.

    Code that the row's file names is not run.

    Raises:
        Mistake: The command line names none, and the row's contestant is not shipped or had changed
            settings.
    """
    if given is not None:
        return given[0]
    ours = {one.name: one for one in (*home_of(benchmark), *scale_of(benchmark))}
    if row.division not in (Division.HOME.name, Division.SCALE.name) or row.contestant not in ours:
        raise Mistake(
            f"the contestant '{row.contestant}' of this row is not shipped, or had changed "
            f"settings: name it with --contestant, as in the row's command: {row.command}"
        )
    return ours[row.contestant]
