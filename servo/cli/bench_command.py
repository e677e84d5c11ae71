"""The command `servobench bench`: compare trackers on sequences or in the closed loop."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from servo.batch.workers import Workers, check_number
from servo.bench import ranking, suites
from servo.bench.ranking import INTERVAL, LEGEND, SHEETS, SHOWN
from servo.bench.sequence_jobs import SequenceJob, track_path
from servo.cli import bench_loop_command
from servo.cli.job_progress import work
from servo.cli.terminal import columns, plain
from servo.output.command_line import command_line
from servo.output.result_folder import result_folder
from tracking.evaluation.drawing import curves
from tracking.evaluation.drawing.contact_sheet import encoded, sheet
from tracking.evaluation.track_file import read as read_track
from tracking.files import atomic

WIDE = 7
"""Most columns of a table that fit beside its names."""
LARGE = 100


def run(
    name: str, trackers: str | None, seeds: int, workers: int, out: Path | None, *, quiet: bool
) -> int:
    """Compare trackers; the exit code: 1 if a run failed.

    Raises:
        Mistake: The suite or a tracker is wrong, or the folder cannot be used.
    """
    folder = out or Path("runs") / f"bench-{Path(name).stem}"
    console = Console(quiet=quiet)
    again = command_line("bench", name, trackers=trackers, seeds=seeds)
    if name == suites.CLOSED_LOOP:
        chosen = suites.contenders(trackers)
        return bench_loop_command.run(chosen, seeds, workers, folder, console, again)
    entries, listed = suites.suite(name)
    chosen = listed if listed and trackers is None else suites.contenders(trackers)
    check_number(len(chosen) * len(entries) * seeds)
    jobs = [SequenceJob(c, e, s) for c in chosen for e in entries for s in range(seeds)]
    title = Path(name).stem
    with Workers(workers) as pool, result_folder(folder, "bench"):
        done, code = work(jobs, folder, pool, console, f"bench {title}")
        results = [d.result for d in done if d.result is not None]
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


def print_rows(console: Console, rows: Sequence[ranking.Row]) -> None:
    """Print the table of all trackers, and success by family if there are several."""
    titles = [w for title in SHOWN for w in ((title, "95 %") if title == INTERVAL else (title,))]
    titles = ("tracker", *titles, "z", "p")
    table = columns(titles, ("tracker",), no_wrap=True, collapse_padding=True)
    for row in rows:
        test = row.against_best
        tested = ("", "") if test is None else (f"{test.z:.2f}", f"{row.p:.3f}")
        cells: list[str] = []
        for title, name in SHOWN.items():
            interval = row.means.get(name)
            cells.append("" if interval is None else _short(interval.value))
            if title == INTERVAL:
                cells.append("" if interval is None else f"{interval.low:.3f}-{interval.high:.3f}")
        table.add_row(escape(row.tracker), *cells, *tested)
    console.print(table)
    plain(console, LEGEND)
    families = list(rows[0].families)
    labels = [row.tracker for row in rows]
    success = [[f"{row.families.get(f) or 0:.2f}" for f in families] for row in rows]
    if 1 < len(families) <= WIDE:
        _print_families(console, ("tracker", *families), labels, success)
    elif len(families) > 1 and len(rows) <= WIDE:
        turned = [list(column) for column in zip(*success, strict=True)]
        _print_families(console, ("sequence", *labels), families, turned)


def _print_families(
    console: Console, titles: Sequence[str], names: Sequence[str], cells: Sequence[Sequence[str]]
) -> None:
    console.print("\nsuccess AUC by sequence")
    table = Table(box=None, pad_edge=False, collapse_padding=True)
    for i, title in enumerate(titles):
        table.add_column(escape(title), justify="right" if i else "left")
    for name, row in zip(names, cells, strict=True):
        table.add_row(escape(name), *row)
    console.print(table)


def _short(value: float) -> str:
    """A number with three digits, or all digits of its whole part."""
    return f"{value:.0f}" if abs(value) >= LARGE else f"{value:.3g}"


def _sheets(jobs: Sequence[SequenceJob], best: str, folder: Path) -> list[Path]:
    """Write a contact sheet of each sequence's first seed with the best tracker's estimate."""
    place = atomic.folder(folder, SHEETS)
    for job in jobs:
        if job.contender.label == best and job.seed == 0:
            sequence = job.entry.build(0)
            found = read_track(track_path(folder, job.key)).corners
            picture = sheet(sequence.source, sequence.truth, found)
            atomic.write(place, f"{sequence.name}.png", encoded(picture))
    return [place]
