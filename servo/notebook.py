"""Progress bars, tables, pictures and films in a Jupyter notebook, as HTML."""

import base64
import sys
import time
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from html import escape
from importlib import import_module
from importlib.util import find_spec
from typing import Any, Protocol

import pyarrow as pa

from servo.report.words import Cell, Table, shown

INTERVAL = 0.2
"""Time between two updates of a bar [s]."""


class Advance(Protocol):
    """Protocol of a function that moves a progress bar: it is called with the number of steps that
    are done so far, and a note to show beside the bar.
    """

    def __call__(self, done: int, note: str = "") -> None: ...


@contextmanager
def progress(title: str, total: int) -> Generator[Advance]:
    """Context manager that shows a progress bar in a notebook, and removes it when its block ends;
    outside a notebook it shows nothing.

    Args:
        title: Text beside the bar.
        total: Number of steps of a full bar.

    Yields:
        A function that sets the number of steps that are done so far, and a note beside the bar; a
        call within 0.2 s of the last shown one has no effect.
    """
    if not in_notebook():
        yield _nothing
        return
    display: Any = import_module("IPython.display")
    handle = display.display(display.HTML(_bar(title, 0, total, "")), display_id=True)
    shown = 0.0

    def advance(done: int, note: str = "") -> None:
        nonlocal shown
        if time.monotonic() - shown > INTERVAL:
            shown = time.monotonic()
            handle.update(display.HTML(_bar(title, done, total, note)))

    try:
        yield advance
    finally:
        handle.update(display.HTML(""))


def _nothing(done: int, note: str = "") -> None:
    del done, note


def in_notebook() -> bool:
    """Return True if this process is an IPython kernel, such as that of a notebook."""
    shell: Any = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return shell is not None and getattr(shell, "kernel", None) is not None


def _bar(title: str, done: int, total: int, note: str) -> str:
    bar = f'<progress value="{done}" max="{total}" style="width:20em"></progress>'
    return f"<div>{escape(title)} {bar} {done} / {total} {escape(note)}</div>"


def frame_of(table: pa.Table) -> Any:
    """Return an Arrow table as a pandas DataFrame; without pandas, return it unchanged."""
    return table if find_spec("pandas") is None else table.to_pandas()


@dataclass(frozen=True, repr=False)
class TextTable:
    """An Arrow table that prints as text with its rows and columns, and is shown as HTML by a
    notebook, for users without pandas. Its other attributes are those of the Arrow table.
    """

    arrow: pa.Table

    def __getattr__(self, name: str) -> Any:
        if name == "arrow":  # a copy is asked before it has one
            raise AttributeError(name)
        return getattr(self.arrow, name)

    def __repr__(self) -> str:
        rows = [self.arrow.column_names, *self._rows()]
        widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
        return "\n".join("  ".join(map(str.ljust, row, widths)).rstrip() for row in rows)

    def _repr_html_(self) -> str:
        return html_table(Table(self.arrow.column_names, self._rows()))

    def _rows(self) -> list[list[str]]:
        return [
            ["" if cell is None else shown(cell) for cell in row.values()]
            for row in self.arrow.to_pylist()
        ]


def html_table(table: Table) -> str:
    """Return the HTML code of a table of texts; special characters of HTML are escaped."""

    def row(cells: Sequence[Cell], tag: str) -> str:
        return f"<tr>{''.join(f'<{tag}>{_text(c)}</{tag}>' for c in cells)}</tr>"

    body = "".join(row(cells, "td") for cells in table.rows)
    return f"<table><thead>{row(table.head, 'th')}</thead><tbody>{body}</tbody></table>"


def _text(cell: Cell) -> str:
    return escape(cell if isinstance(cell, str) else cell.text)


def html_picture(png: bytes) -> str:
    """Return the HTML code of an image that holds a PNG file, given the bytes of the file."""
    return (
        f'<img style="max-width:100%" src="data:image/png;base64,{base64.b64encode(png).decode()}">'
    )


def html_film(mp4: bytes) -> str:
    """Return the HTML code of a video player that holds an MP4 file, given the bytes of the
    file.
    """
    source = f"data:video/mp4;base64,{base64.b64encode(mp4).decode()}"
    return f'<video controls loop style="max-width:100%" src="{source}"></video>'
