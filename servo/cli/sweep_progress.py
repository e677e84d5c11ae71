"""What is seen of a study while it runs: done, running, failed, rate, time left."""

from __future__ import annotations

import time
from datetime import timedelta

from rich.console import Console
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table

TITLES = ("done", "running", "failed", "of", "runs a minute", "time left")
AGAIN = 4
"""How often the table is drawn anew [1/s]."""


class StudyProgress:
    """A live table; use it in a `with`. It is gone when the work is done."""

    def __init__(self, console: Console, name: str, total: int, before: int, workers: int) -> None:
        """Begin.

        Args:
            console: Where it is drawn.
            name: Of the study.
            total: Number of its runs.
            before: How many of them were finished already.
            workers: How many run at once.
        """
        self._name, self._total, self._before, self._workers = name, total, before, workers
        self._done = self._failed = 0
        self._began = time.monotonic()
        self._live = Live(console=console, refresh_per_second=AGAIN, transient=True,
                          get_renderable=self._drawn)  # fmt: skip

    def __enter__(self) -> StudyProgress:
        self._live.__enter__()
        return self

    def __exit__(self, *told: object) -> None:
        self._live.stop()

    def ended(self, *, failed: bool) -> None:
        """Count a run that has ended."""
        self._done += not failed
        self._failed += failed

    def _drawn(self) -> Table:
        ended, left = self._done + self._failed, self._left()
        passed = time.monotonic() - self._began
        rate = f"{60 * ended / passed:.1f}" if ended else ""
        remaining = str(timedelta(seconds=round(left * passed / ended))) if ended else "starting"
        table = Table(box=None, pad_edge=False, title=f"sweep {self._name}", title_justify="left")
        for title in TITLES:
            table.add_column(title, justify="right")
        done, running = self._before + self._done, min(self._workers, left)
        failed = f"[red]{self._failed}[/]" if self._failed else "0"
        table.add_row(str(done), str(running), failed, str(self._total), rate, remaining)
        whole = Table.grid()
        whole.add_row(table)
        whole.add_row(ProgressBar(self._total, self._before + ended, width=60))
        return whole

    def _left(self) -> int:
        return self._total - self._before - self._done - self._failed
