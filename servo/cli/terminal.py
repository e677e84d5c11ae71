"""Printing that all commands share: progress bars, tables, plain lines, and the end by a signal."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NoReturn

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from servo.batch.jobs import Done, Job, stored
from servo.batch.workers import Workers
from servo.cli.guard import exit_code
from servo.mistake import FULL, Mistake
from servo.output.result_folder import GOES_ON
from servo.report import words
from tracking.files import atomic

STOPPED = "servobench: stopped; what was written is complete up to here."
COMPILING = "(the first run on a machine compiles the hot loops)"
ROOMY = 6
"""Most columns with wide gaps."""
WAITING = f"preparing {COMPILING}"
COLOURS = {words.Tone.GOOD: "green", words.Tone.BAD: "red", words.Tone.PLAIN: "bold"}


def progress_bar(console: Console) -> Progress:
    """A bar with count, time left, and a note; it disappears when the work is done."""
    title = TextColumn("{task.description}")
    note = TextColumn("{task.fields[note]}")
    columns = (title, BarColumn(), MofNCompleteColumn(), TimeRemainingColumn(), note)
    return Progress(*columns, console=console, transient=True)


def print_table(console: Console, shown: words.Table) -> None:
    """Print a table and its note; long texts wrap, so that numbers keep all their digits."""
    table = Table(box=None, pad_edge=False, collapse_padding=len(shown.head) > ROOMY)
    for i, title in enumerate(shown.head):
        is_text = i in shown.words
        justify = "left" if is_text else "right"
        table.add_column(escape(title), justify=justify, overflow="fold", no_wrap=not is_text)
    for row in shown.rows:
        table.add_row(*map(_marked, row))
    console.print(table)
    if shown.note:
        plain(console, shown.note)


def _marked(cell: words.Cell) -> str:
    if isinstance(cell, str):
        return escape(cell)
    return f"[{COLOURS[cell.tone]}]{escape(cell.text)}[/]"


def plain(console: Console, text: str) -> None:
    """Print a path or a command unchanged: without colours, line breaks and markup."""
    console.print(text, highlight=False, soft_wrap=True, markup=False)


def complain(sentence: object) -> None:
    """Print a sentence on stderr."""
    plain(Console(stderr=True), f"servobench: {sentence}")


def stop(cause: KeyboardInterrupt, more: str = "") -> NoReturn:
    """Print that Ctrl-C or another signal stopped the command, and end the program."""
    plain(Console(stderr=True), f"{STOPPED} {more}".rstrip())
    raise SystemExit(exit_code(cause))


FAILURES = "failures"


def work(
    jobs: Sequence[Job], folder: Path, pool: Workers, console: Console, title: str
) -> tuple[list[dict[str, Any]], int]:
    """Do jobs with a progress bar; the results in order, and the exit code: 1 for failures.

    Raises:
        Mistake: Two jobs have the same name.
        OSError: The disk is full.
    """
    keys = [job.key for job in jobs]
    double = next((key for key, count in Counter(keys).items() if count > 1), None)
    if double is not None:
        raise Mistake(f"two runs are called '{double}'; give the trackers different labels")
    done: dict[str, Done] = {}
    for job in jobs:
        try:
            if (result := stored(job, folder)) is not None:
                done[job.key] = Done(job, result)
        except Mistake as damaged:
            complain(f"{damaged}; it is computed again")
    todo = [job for job in jobs if job.key not in done]
    try:
        with progress_bar(console) as bar:
            task = bar.add_task(escape(title), total=len(jobs), completed=len(done), note=COMPILING)
            for one in pool.results(todo, folder):
                done[one.job.key] = one
                if one.refused is not None and one.refused.errno in FULL:
                    raise one.refused
                bar.update(task, advance=1, note=escape(one.job.key))
    except KeyboardInterrupt as cause:
        stop(cause, f"{GOES_ON.capitalize()}.")
    failed = [d for d in done.values() if d.result is None]
    for d in failed:
        reason = d.error.strip().splitlines()[-1]
        path = atomic.write(folder, f"{FAILURES}/{d.job.key}.txt", d.error)
        complain(f"{d.job.key} failed: {reason}; see {path}")
    results = [done[key].result for key in keys if key in done]
    return [r for r in results if r is not None], 1 if failed else 0
