"""Printing that all commands share: progress bars, tables, plain lines, and the end by a signal."""

import shlex
import time
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from servo.cli.guard import exit_code
from servo.mistake import Mistake, Refused
from servo.report import words
from servo.study.execute import Workers, complete
from servo.study.run import ClusterLost, Failure, Job
from servo.study.store import Store

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


def go_on(command: str, out: Path | None) -> str:
    """How a stopped command goes on; `out` is its option."""
    return f"go on with: {command}" + (f" --out {shlex.quote(str(out))}" if out else "")


def complete_jobs(
    jobs: Sequence[Job],
    store: Store,
    workers: Workers,
    console: Console,
    title: str,
    again: str,
) -> int:
    """Do the jobs that have no record in a store, with a progress bar; how many failed.

    Args:
        jobs: All jobs of the study.
        store: Its folder.
        workers: Where they are done.
        console: For the progress bar.
        title: Beside the bar.
        again: How to go on when the workers are gone or the user stops the command.

    Raises:
        Mistake: The user's cluster has stopped.
        Refused: The disk is full, or the workers of this machine have stopped.
    """
    store.find(jobs)
    if store.damaged:
        complain(
            f"{store.damaged[0]}: this is not the run's row as it was written (the first of "
            f"{len(store.damaged)} such files); what is missing is run again"
        )
    failed: list[tuple[Job, Failure]] = []
    began = time.monotonic()
    try:
        with progress_bar(console) as bar:
            done = len(store.done)
            board = bar.add_task(escape(title), total=len(jobs), completed=done, note=COMPILING)
            for count, (job, end) in enumerate(complete(jobs, store, workers), 1):
                failed += [(job, end)] if isinstance(end, Failure) else []
                rate = 60 * count / (time.monotonic() - began)
                bar.update(board, advance=1, note=f"{rate:.1f} a minute, {len(failed)} failed")
    except KeyboardInterrupt as cause:
        stop(cause, f"{len(store.done)} of {len(jobs)} runs are finished; {again}")
    except ClusterLost as lost:
        sentence = f"{lost}; {len(store.done)} of {len(jobs)} runs are finished; {again}"
        raise (Refused if workers.scheduler is None else Mistake)(sentence) from None
    for job, failure in failed:
        complain(f"{store.failure_path(job)}: {failure.reason}")
    return len(failed)
