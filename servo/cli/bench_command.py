"""The command `servobench bench`: compare trackers on sequences or in the closed loop."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from servo.batch.workers import Workers, check_number
from servo.bench import loop_jobs, ranking, suites
from servo.bench.loop_jobs import LoopJob, LoopRun
from servo.bench.sequence_jobs import SequenceJob, track_path
from servo.cli.terminal import plain, print_table, work
from servo.output.formats import command_line
from servo.output.result_folder import result_folder
from servo.report import bench_section
from sim.camera import gl
from tracking.drawing import curves
from tracking.drawing.contact_sheet import sheet
from tracking.drawing.picture_bytes import encoded
from tracking.evaluation.track_file import read as read_track
from tracking.files import atomic

WIDE = 7
"""Most columns of a table that fit beside its names."""


def run(
    suite: str, trackers: str | None, seeds: int, workers: int, out: Path | None, quiet: bool
) -> int:
    """Compare trackers; the exit code: 1 if a run failed.

    Raises:
        Mistake: The suite or a tracker is wrong, or the folder cannot be used.
    """
    folder = out or Path("runs") / f"bench-{Path(suite).stem}"
    console = Console(quiet=quiet)
    again = command_line("bench", suite, trackers=trackers, seeds=seeds)
    if suite == suites.CLOSED_LOOP:
        jobs = _loop_jobs(trackers, seeds)
        with Workers(workers) as pool, result_folder(folder, "bench closed_loop"):
            results, code = work(jobs, folder, pool, console, "bench closed loop")
            runs = [LoopRun(**result) for result in results]
            paths = loop_jobs.write(runs, folder, again) if runs else []
        if runs:
            print_table(console, bench_section.loop_table(runs))
    else:
        jobs = _sequence_jobs(suite, trackers, seeds)
        title = Path(suite).stem
        with Workers(workers) as pool, result_folder(folder, "bench"):
            results, code = work(jobs, folder, pool, console, f"bench {title}")
            if not results:
                return code
            rows = ranking.rows_of(results)
            paths = ranking.write(results, rows, folder, again)
            paths += curves.draw(results, [row.tracker for row in rows], title, folder)
            paths += _sheets(jobs, rows[0].tracker, folder)
        print_rows(console, rows)
    for path in paths:
        plain(console, f"  {path}")
    return code


def _sequence_jobs(suite: str, trackers: str | None, seeds: int) -> list[SequenceJob]:
    entries, listed = suites.suite(suite)
    chosen = listed if listed and trackers is None else suites.contenders(trackers)
    check_number(len(chosen) * len(entries) * seeds)
    return [SequenceJob(c, e, s) for c in chosen for e in entries for s in range(seeds)]


def _loop_jobs(trackers: str | None, seeds: int) -> list[LoopJob]:
    chosen = suites.contenders(trackers)
    names = loop_jobs.SCENARIOS
    gl.backend()
    check_number(len(chosen) * len(names) * seeds)
    return [LoopJob(c, name, s) for c in chosen for name in names for s in range(seeds)]


def print_rows(console: Console, rows: Sequence[ranking.Row]) -> None:
    """Print the table of all trackers, and success by sequence if there are several."""
    print_table(console, bench_section.trackers_table(rows))
    families = bench_section.families_table(rows)
    if families is not None and len(families.head) <= WIDE + 1:
        console.print()
        print_table(console, families)


def _sheets(jobs: Sequence[SequenceJob], best: str, folder: Path) -> list[Path]:
    """Write a contact sheet of each sequence's first seed with the best tracker's estimate."""
    place = atomic.folder(folder, ranking.SHEETS)
    for job in jobs:
        if job.contender.label == best and job.seed == 0:
            sequence = job.entry.build(0)
            found = read_track(track_path(folder, job.key)).corners
            picture = sheet(sequence.source, sequence.truth, found)
            atomic.write(place, f"{sequence.name}.png", encoded(picture))
    return [place]
