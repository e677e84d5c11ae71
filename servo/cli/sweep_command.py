"""The command `servobench sweep`: do the missing runs of a study, store and summarise them."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from servo.batch.ended import Lost
from servo.batch.local_cluster import check_workers, local
from servo.batch.remote_cluster import check_settings, remote
from servo.batch.tasks import carry_out
from servo.cli.sweep_progress import StudyProgress
from servo.cli.terminal import plain, stop
from servo.mistake import Mistake, Refused
from servo.output.command_line import command_line
from servo.study.parse import load
from servo.study.perform import perform
from servo.study.plan import Study
from servo.study.results import Cell, cells_csv, cells_of, comparisons, comparisons_csv, missed
from servo.study.run_file import parquet
from servo.study.store import COMPARISONS, RESULTS, Store
from servo.study.study_file import StudyFile
from sim import gl

SHOWN = {"rms": "servo_rms_px", "peak": "servo_peak_px", "tracker": "tracking_rms_px",
         "ms": "track_ms"}  # fmt: skip
"""Measures in the table, by the titles of their columns."""
LEGEND = (
    "held: share of runs with the expected outcome, with its 95 % bootstrap interval; true centre "
    "against the goal, rms and\npeak [px]; estimate against truth, rms [px]; tracker's time [ms]: "
    "means over runs"
)
MOST_SHOWN = 60
"""Most cells in the printed table; the files have all."""


@dataclass(frozen=True, slots=True)
class SweepRequest:
    """The options of the command line."""

    study: str
    changes: Sequence[str]
    seeds: int | None
    workers: int
    scheduler: str | None
    out: Path | None
    quiet: bool

    @property
    def command(self) -> str:
        """The command line, without --out, --workers and --scheduler."""
        return command_line("sweep", self.study, set=list(self.changes), seeds=self.seeds)


def run(request: SweepRequest) -> int:
    """Do the missing runs of a study; the exit code: 1 if a run failed or a bound was missed.

    Raises:
        Mistake: The study or its folder is wrong, or the scheduler cannot be used.
        Refused: A file cannot be written, or the workers cannot work.
    """
    console = Console(quiet=request.quiet)
    with console.status("reading the study"):
        study = load(request.study, request.changes, request.seeds)
    folder = request.out or Path("runs") / f"sweep-{study.name}"
    if request.scheduler is None:
        check_workers(request.workers)
        gl.backend()
    else:
        check_settings(request.scheduler)
    with Store(folder, study, StudyFile.of(study, request.command)) as store:
        _print_damaged(store.damaged)
        try:
            failed = _work(study, store, request, console)
            code = _sum_up(study, store, console)
        except KeyboardInterrupt as cause:
            stop(cause, _again(store, study, request))
        except Lost as lost:
            kind = Refused if request.scheduler is None else Mistake
            raise kind(f"{lost}; {_again(store, study, request)}") from None
    for path, error in failed:
        plain(Console(stderr=True), f"servobench: {path}: {error}")
    return 1 if failed else code


def _work(
    study: Study, store: Store, request: SweepRequest, console: Console
) -> list[tuple[Path, str]]:
    """Do the missing runs; the file of each failed run, with the last line of its error."""
    done = store.done()
    failed: list[tuple[Path, str]] = []
    if len(done) == study.size:
        return failed
    missing = (r for r in study.runs() if r.number not in done)
    with (
        StudyProgress(console, study.name, study.size, len(done), request.workers) as board,
        local(request.workers)
        if request.scheduler is None
        else remote(request.scheduler) as cluster,
    ):
        for task, ended in carry_out(cluster, missing, perform):
            if ended.error:
                path = store.fail(task, ended.error, task.command(study.changes))
                failed.append((path, ended.reason))
            else:
                store.add(ended.value)
            board.ended(failed=bool(ended.error))
    return failed


def _print_damaged(paths: Sequence[Path]) -> None:
    if paths:
        plain(
            Console(stderr=True),
            f"servobench: {paths[0]}: this is not the run's row as it was written (the first of "
            f"{len(paths)} such files); what is missing is run again",
        )


def _again(store: Store, study: Study, request: SweepRequest) -> str:
    there = f"{len(store.done())} of {study.size} runs are finished; "
    out = f" --out {shlex.quote(str(request.out))}" if request.out else ""
    return f"{there}go on with: {request.command}{out}"


def _sum_up(study: Study, store: Store, console: Console) -> int:
    """Write the tables and print a summary; the exit code: 1 if a bound was missed."""
    done = store.done()
    if not done:
        return 0
    table = store.table(done)
    rows = table.to_pylist()
    cells, pairs = cells_of(study, rows), comparisons(study, rows)
    _print_cells(console, cells)
    paths = [store.write(RESULTS, parquet(table))]
    paths.append(store.write("cells.csv", cells_csv(study, cells)))
    if pairs:
        paths.append(store.write(COMPARISONS, comparisons_csv(pairs)))
        for c in [c for c in pairs if c.p_holm < 0.05][:10]:
            console.print(
                f"{escape(str(c.first))} holds more often than {escape(str(c.second))}: "
                f"{c.test.wins} to {c.test.losses}, p = {c.p_holm:.2g} after Holm"
            )
    for path in paths:
        plain(console, f"  {path}")
    plain(console, f"for a page, run: servobench report {shlex.quote(str(store.folder))}")
    not_kept = missed([axis.key for axis in study.every_axis], study.expect, rows)
    for line in not_kept:
        plain(Console(stderr=True), f"servobench: {line}")
    return 1 if not_kept else 0


def _print_cells(console: Console, cells: Sequence[Cell]) -> None:
    table = Table(box=None, pad_edge=False, collapse_padding=True)
    for key in cells[0].settings:
        # Long texts wrap, so that numbers keep all their digits.
        table.add_column(escape(key).replace(".", ".\n", 1), overflow="fold")
    for title in ("runs", "held", "95 %", *SHOWN):
        table.add_column(title, justify="right", no_wrap=True)
    for cell in cells[:MOST_SHOWN]:
        held = cell.success
        means = [cell.means.get(name) for name in SHOWN.values()]
        table.add_row(
            *(escape(_short(v)) for v in cell.settings.values()), str(cell.runs),
            f"{held.value:.2f}", f"{held.low:.2f}-{held.high:.2f}",
            *("" if m is None else _short(m.value) for m in means),
        )  # fmt: skip
    console.print(table)
    if len(cells) > MOST_SHOWN:
        console.print(f"... and {len(cells) - MOST_SHOWN} cells more, in cells.csv")
    plain(console, LEGEND)


def _short(value: Any) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)
