"""Printing for all commands on the terminal: progress bars, tables and plain lines."""

from collections.abc import Iterable
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path

from rich import markup
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from servo.mistake import one_line, printable
from servo.report import words

COMPILING = "(the first run on a machine compiles the hot loops)"
ROOMY = 6
"""Largest number of columns of a table with two spaces between columns; wider tables have one."""
WAITING = f"preparing {COMPILING}"
NARROWEST = 12
"""Least width of a column of words where the numbers beside it leave no room [characters]; a word,
such as a name, is not broken."""
COLOURS = {words.Tone.GOOD: "green", words.Tone.BAD: "red", words.Tone.PLAIN: "bold"}


def escape(text: str) -> str:
    """Return a text that rich prints literally: rich's markup and control characters (but line
    breaks) are escaped.
    """
    return markup.escape(printable(text))


def moves(console: Console) -> bool:
    """Return True if a console is a terminal, which can show animated text such as a progress
    bar.
    """
    # In a pipe, FORCE_COLOR makes `is_terminal` true, but asks for colours only.
    return console.is_terminal and console.file.isatty()


def waiting(console: Console, text: str) -> AbstractContextManager[object]:
    """Return a context manager that shows a text with a spinner until its block ends; it shows
    nothing where the console is no terminal.
    """
    return console.status(text) if moves(console) else nullcontext()


def progress_bar(console: Console) -> Progress:
    """Return a progress bar with title, count, time left and a note, which disappears at the end;
    it shows nothing where the console is no terminal. Each task needs a field `note`.
    """
    title = TextColumn("{task.description}")
    note = TextColumn("{task.fields[note]}")
    columns = (title, BarColumn(), MofNCompleteColumn(), TimeRemainingColumn(), note)
    return Progress(*columns, console=console, transient=True, disable=not moves(console))


def print_table(console: Console, shown: words.Table) -> None:
    """Print a table, then its note. Columns of text wrap, and numbers keep all their digits, even
    if the table is then wider than the terminal.
    """
    table = Table(box=None, pad_edge=False, collapse_padding=len(shown.head) > ROOMY)
    for i, title in enumerate(shown.head):
        is_text = i in shown.words
        cells = [title, *(_text(row[i]) for row in shown.rows if i < len(row))]
        longest = max(len(line) for cell in cells for line in cell.split("\n"))
        word = max((len(word) for cell in cells for word in cell.split()), default=0)
        table.add_column(
            escape(title),
            justify="left" if is_text else "right",
            overflow="fold",
            no_wrap=not is_text,
            min_width=min(longest, max(word, NARROWEST)) if is_text else longest,
        )
    for i, row in enumerate(shown.rows):
        table.add_row(*map(_marked, row), style="dim" if i in shown.faint else "")
    # A terminal breaks a line that is too long; Rich would cut off digits and whole columns.
    gap = 2 if len(shown.head) <= ROOMY else 1
    needed = sum((column.min_width or 0) + gap for column in table.columns)
    table.width = needed if needed > console.width else None
    console.print(table, crop=False)
    plain(console, shown.note)


def _text(cell: words.Cell) -> str:
    """Return the text of a table's cell without its colour."""
    return cell if isinstance(cell, str) else cell.text


def _marked(cell: words.Cell) -> str:
    """Return the text of a table's cell with rich's markup of its colour."""
    text = escape(_text(cell))
    return text if isinstance(cell, str) else f"[{COLOURS[cell.tone]}]{text}[/]"


def plain(console: Console, *lines: str) -> None:
    """Print lines literally: without colours, added line breaks and markup, and with control
    characters escaped. Empty lines are skipped.
    """
    for line in filter(None, lines):
        console.print(printable(line), highlight=False, soft_wrap=True, markup=False)


def print_paths(console: Console, paths: Iterable[Path]) -> None:
    """Print the paths of written files, one on each line, indented by two spaces."""
    plain(console, *(f"  {path}" for path in paths))


def complain(*sentences: str) -> None:
    """Print sentences about problems on stderr, one on each line, each after "servobench: "."""
    plain(Console(stderr=True), *(f"servobench: {one_line(each)}" for each in sentences))
