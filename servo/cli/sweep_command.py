"""The command `servobench sweep`: do the missing runs of a study and summarise all its runs."""

import shlex
from collections.abc import Iterable, Sequence
from itertools import islice
from pathlib import Path

from rich.console import Console

from servo.cli.jobs import complete_jobs, go_on, print_estimate
from servo.cli.terminal import complain, escape, plain, print_paths, print_table, waiting
from servo.cli.try_out import try_out
from servo.mistake import check_known
from servo.output.formats import command_line
from servo.report.study_data import cell_row
from servo.report.words import Table
from servo.scenario.load import Scenario
from servo.study.bounds import doubtful_bounds, missed_by_cells
from servo.study.execute import Workers
from servo.study.parse import load
from servo.study.plan import MOST_VALUES, Study
from servo.study.record_file import rows_of
from servo.study.results import (
    COMPARED,
    Cell,
    cells_csv,
    cells_of,
    comparisons,
    grouped,
    moved,
    uncounted,
)
from servo.study.run import Job
from servo.study.scenario_run import MEASURED, RECORDED, StudiedScenario
from servo.study.store import Store, StudyFile, opened
from sim.camera import gl
from tracking.files.csv_text import csv_text

MOST_SHOWN = 60
"""Most cells in the printed table; the files have all."""
MOST_TRIED = 200
"""Most scenarios of a study without bounds whose trackers are tried before the first run."""


def run(
    study: str,
    changes: Sequence[str],
    seeds: int | None,
    workers: int,
    scheduler: str | None,
    out: Path | None,
    quiet: bool,
    dry_run: bool = False,
    measures: str | None = None,
) -> int:
    """Do the missing runs of a study (scenarios over axes of settings and seeds), and write and
    print its tables.

    Args:
        study: A shipped study or a TOML file.
        changes: Changes of settings of all runs, such as "run.duration=5".
        seeds: Number of seeds: 0, 1, 2, ...; None: those of the study.
        workers: Number of processes on this machine.
        scheduler: Address of a Dask scheduler to work on instead; None: this machine.
        out: The folder to write; None: runs/sweep-STUDY.
        quiet: Whether to print on stderr only: mistakes, failed runs and missed bounds.
        dry_run: Whether to print only how many runs there are and how long they take.
        measures: Columns of the table, with commas between them; None: those that differ most.

    Returns:
        The exit code: 1 if a run failed or a bound was missed, else 0.

    Raises:
        Mistake: The study or its folder is wrong, or the scheduler cannot be used.
        Refused: A file cannot be written, or the workers cannot work.
    """
    console = Console(quiet=quiet)
    with waiting(console, "reading the study"):
        parsed = load(study, changes, seeds)
    chosen = None if measures is None else measures_of(measures)
    if scheduler is None:
        gl.is_there()
    again = command_line("sweep", study, set=list(changes), seeds=seeds)
    pool = Workers(workers, scheduler)
    return run_study(parsed, again, pool, out, console, dry_run=dry_run, measures=chosen)


def measures_of(text: str) -> list[str]:
    """Return the names in a text of measures with commas between them, such as
    "servo_rms_px,age_ms", each once.

    Raises:
        Mistake: There is no such measure.
    """
    names = [name.strip() for name in text.split(",")]
    check_known(names, MEASURED, "--measures", "measure")
    return list(dict.fromkeys(names))


def run_study(
    study: Study,
    command: str,
    workers: Workers,
    out: Path | None,
    console: Console,
    *,
    dry_run: bool = False,
    measures: Sequence[str] | None = None,
    has_page: bool = False,
) -> int:
    """Do the missing runs of a study, and write and print its tables.

    Args:
        study: The study.
        command: The command line that repeats it.
        workers: The processes that do the runs.
        out: The folder to write; None: runs/sweep-STUDY.
        console: The output of the command.
        dry_run: Whether to print only how many runs there are and how long they take.
        measures: Columns of the printed table; None: those that differ most.
        has_page: Whether the caller writes an HTML page; else the command that writes one is
            printed.

    Returns:
        The exit code: 1 if a run failed or a bound was missed, else 0.

    Raises:
        Mistake: A tracker cannot be started, or the folder or the scheduler cannot be used.
        Refused: A file cannot be written, or the workers cannot work.
    """
    most = MOST_VALUES if study.expect else MOST_TRIED
    samples = [_parsed(job) for job in islice(study.samples(), most)]
    plain(console, *_doubts(study, samples))
    if workers.scheduler is None:  # else the workers' machines have the programs
        try_out((scenario.tracker for scenario in samples), console)
    folder = out or Path("runs") / f"sweep-{study.name}"
    if dry_run:
        at_once = workers.count if workers.scheduler is None else None
        return print_estimate(list(study.jobs()), at_once, console, Store(folder))
    with opened(folder, StudyFile.of(study, command)) as store, workers:
        jobs = list(study.jobs())
        store.find(jobs)
        title = f"sweep {study.name}"
        failed = complete_jobs(jobs, store, workers, console, title, go_on(command, out))
        if not store.done:
            return 1 if failed else 0
        code = _sum_up(study, store, console, measures)
        if not has_page:
            place = shlex.quote(str(store.folder))
            plain(console, f"for a page of results, run: servobench report {place}")
    return 1 if failed else code


def _parsed(job: Job) -> Scenario:
    """Return the scenario of a run, with its seed and settings."""
    base = job.subject
    assert isinstance(base, StudiedScenario)
    return base.parsed(job.seed, job.settings)


def _doubts(study: Study, samples: Iterable[Scenario]) -> list[str]:
    """Return a sentence for each bound of the study that every run with some settings will miss, or
    that every run with some settings will keep.

    Args:
        study: The study.
        samples: A scenario with each of the study's settings.
    """
    if not study.expect:
        return []
    lines = [line for each in samples for line in doubtful_bounds(study.expect, each)]
    return list(dict.fromkeys(lines))


def _sum_up(study: Study, store: Store, console: Console, measures: Sequence[str] | None) -> int:
    """Write the tables of runs, of cells (combinations of axis values) and of comparisons, and
    print a summary; return the exit code: 1 if a bound was missed, else 0.
    """
    table = store.table()
    rows = rows_of(table)
    cells = cells_of(study, rows)
    pairs = comparisons(study.compare, study.keys, rows, drawn=bool(study.draws))
    _print_cells(console, cells, moved(cells) if measures is None else measures)
    paths = store.export(table)
    paths.append(store.write("cells.csv", cells_csv(study, cells)))
    if pairs:
        paths.append(store.write("comparisons.csv", csv_text(COMPARED, [c.cells for c in pairs])))
        for c in [c for c in pairs if c.p_holm < 0.05 and c.test.wins > c.test.losses][:10]:
            console.print(
                f"{escape(str(c.first))} succeeds more often than {escape(str(c.second))}: "
                f"in {c.test.wins} {c.unit}s against {c.test.losses}, p = {c.p_holm:.2g} after Holm"
            )
    print_paths(console, paths)
    plain(console, uncounted(rows))
    missed = missed_by_cells(grouped(study.keys, rows), study.expect)
    complain(*missed)
    return 1 if missed else 0


def _print_cells(console: Console, cells: Sequence[Cell], measures: Sequence[str]) -> None:
    keys = [key.replace(".", ".\n", 1) for key in cells[0].settings]
    titles = [name.replace("_", "_\n", 1) for name in measures]
    rows = [cell_row(cell, measures) for cell in cells[:MOST_SHOWN]]
    print_table(console, Table((*keys, "units", "success", *titles), rows, range(len(keys))))
    if len(cells) > MOST_SHOWN:
        console.print(f"... and {len(cells) - MOST_SHOWN} more rows in cells.csv")
    plain(
        console,
        "success: share of runs with the expected outcome, with its 95 % interval over the units",
        *(f"{name}: {RECORDED[name]}" for name in measures),
    )
