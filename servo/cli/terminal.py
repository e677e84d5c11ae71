"""Printing that all commands share: progress, plain lines, messages of waiting and stopping."""

from __future__ import annotations

from typing import NoReturn

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from servo.cli.signals import exit_code

STOPPED = "servobench: stopped; what was written is complete up to here."
COMPILING = "(the first run on a machine compiles the hot loops)"
WAITING = f"preparing {COMPILING}"


def progress_bar(console: Console) -> Progress:
    """A bar with count, time left, and a note; it is gone when the work is done."""
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
    )
    return Progress(*columns, TextColumn("{task.fields[note]}"), console=console, transient=True)


def plain(console: Console, text: str) -> None:
    """Print paths and commands as they are: no colours, no line breaks, no markup."""
    console.print(text, highlight=False, soft_wrap=True, markup=False)


def stop(cause: KeyboardInterrupt, more: str = "") -> NoReturn:
    """Print that Ctrl-C or another ending signal arrived, and end the program."""
    plain(Console(stderr=True), f"{STOPPED} {more}".rstrip())
    raise SystemExit(exit_code(cause))
