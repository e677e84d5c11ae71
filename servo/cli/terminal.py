"""Printing that all commands share: progress bars, tables, plain lines, and the end by a signal."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import Any, NoReturn

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from servo.cli.signals import exit_code

STOPPED = "servobench: stopped; what was written is complete up to here."
COMPILING = "(the first run on a machine compiles the hot loops)"
WAITING = f"preparing {COMPILING}"


def progress_bar(console: Console) -> Progress:
    """A bar with count, time left, and a note; it disappears when the work is done."""
    title, note = TextColumn("{task.description}"), TextColumn("{task.fields[note]}")
    columns = (title, BarColumn(), MofNCompleteColumn(), TimeRemainingColumn(), note)
    return Progress(*columns, console=console, transient=True)


def columns(
    titles: Iterable[str], words: Collection[str] = (), *, no_wrap: bool = False, **style: Any
) -> Table:
    """A table without lines; the columns in `words` are left-aligned, the others right-aligned."""
    table = Table(box=None, pad_edge=False, **style)
    for title in titles:
        justify = "left" if title in words else "right"
        table.add_column(title, justify=justify, no_wrap=no_wrap)
    return table


def plain(console: Console, text: str) -> None:
    """Print a path or a command unchanged: without colours, line breaks and markup."""
    console.print(text, highlight=False, soft_wrap=True, markup=False)


def stop(cause: KeyboardInterrupt, more: str = "") -> NoReturn:
    """Print that Ctrl-C or another signal stopped the command, and end the program."""
    plain(Console(stderr=True), f"{STOPPED} {more}".rstrip())
    raise SystemExit(exit_code(cause))
