"""The live table of a running study: runs done, running and failed, rate, time left."""

from __future__ import annotations

import time
from datetime import timedelta

from rich.console import Console
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table

from servo.cli.terminal import columns

TITLES = ("done", "running", "failed", "of", "runs a minute", "time left")
AGAIN = 4
"""Rate at which the table is redrawn [1/s]."""


class StudyProgress:
    """A live table, used in a `with`; it disappears when the work is done."""

    def __init__(self, console: Console, name: str, total: int, before: int, workers: int) -> None:
        """Begin.

        Args:
            console: The console to draw on.
            name: Name of the study.
            total: Number of its runs.
            before: Number of runs that were finished earlier.
            workers: Number of runs at the same time.
        """
        self._name, self._total, self._before, self._workers = name, total, before, workers
        self._done = self._failed = 0
        self._began = time.monotonic()
        self._live = Live(console=console, refresh_per_second=AGAIN, transient=True,
                          get_renderable=self._drawn)  # fmt: skip

    def __enter__(self) -> StudyProgress:
        self._live.__enter__()
        return self

    def __exit__(self, *error: object) -> None:
        self._live.stop()

    def ended(self, *, failed: bool) -> None:
        """Count a run that has ended."""
        self._done += not failed
        self._failed += failed

    def _drawn(self) -> Table:
        ended = self._done + self._failed
        left = self._total - self._before - ended
        passed = time.monotonic() - self._began
        rate = f"{60 * ended / passed:.1f}" if ended else ""
        remaining = str(timedelta(seconds=round(left * passed / ended))) if ended else "starting"
        table = columns(TITLES, title=f"sweep {self._name}", title_justify="left")
        done, running = self._before + self._done, min(self._workers, left)
        failed = f"[red]{self._failed}[/]" if self._failed else "0"
        table.add_row(str(done), str(running), failed, str(self._total), rate, remaining)
        whole = Table.grid()
        whole.add_row(table)
        whole.add_row(ProgressBar(self._total, self._before + ended, width=60))
        return whole
