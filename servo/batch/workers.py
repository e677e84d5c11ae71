"""Worker processes on this machine, which do jobs and other tasks, and how a task ended."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Any, TypeVar

from servo.batch.jobs import Done, Job, attempt
from servo.mistake import Mistake, Refused

Task = TypeVar("Task")


class Lost(RuntimeError):
    """A cluster that has stopped working; the message names it and the reason."""


@dataclass(frozen=True, slots=True)
class Ended:
    """How a task ended."""

    value: Any
    error: str = ""
    """The traceback of a failure; empty if there was none."""
    mistake: str = ""
    """The sentence of a failure that is the user's mistake; empty otherwise."""

    @property
    def reason(self) -> str:
        """The user's mistake, or the last line of the traceback."""
        return self.mistake or self.error.strip().splitlines()[-1]


def failed(error: BaseException) -> Ended:
    """How a task ended that raised an error."""
    mistake = str(error) if isinstance(error, Mistake) else ""
    return Ended(None, "".join(traceback.format_exception(error)), mistake)


def one_by_one(tasks: Iterable[Task], work: Callable[[Task], Any]) -> Iterator[tuple[Task, Ended]]:
    """Do tasks in this process, one after the other."""
    for task in tasks:
        try:
            ended = Ended(work(task))
        except Exception as error:
            ended = failed(error)
        yield task, ended


Task = TypeVar("Task")
MOST_RUNS = 100_000
"""Most runs of one command: more would not fit into memory."""


def check_number(runs: int) -> None:
    """Refuse more runs than the limit.

    Raises:
        Mistake: There are too many.
    """
    if runs > MOST_RUNS:
        raise Mistake(f"these are {runs:,} runs; the limit is {MOST_RUNS:,}")


class Workers(ExitStack):
    """Processes that do jobs, started with the first task; used in a `with`."""

    def __init__(self, workers: int) -> None:
        """Set the number of processes; they start with the first task.

        Args:
            workers: Number of processes; 1: work in this process.

        Raises:
            Mistake: The machine cannot run so many.
        """
        super().__init__()
        self._workers = workers
        if workers > 1:
            from servo.batch.local_cluster import check_workers  # Dask takes a second to import

            check_workers(workers)

    def results(self, jobs: Sequence[Job], folder: Path) -> Iterator[Done]:
        """Do jobs and store their results in a folder; yields each as it ends."""
        for job, ended in self.ends(jobs, partial(attempt, folder=folder)):
            yield Done(job, None, ended.error) if ended.error else ended.value

    def ends(
        self, tasks: Sequence[Task], work: Callable[[Task], Any]
    ) -> Iterator[tuple[Task, Ended]]:
        """Do tasks; yields each task when it ends.

        Raises:
            Refused: The worker processes cannot work.
        """
        if self._workers == 1 or not tasks:
            yield from one_by_one(tasks, work)
            return
        from servo.batch.cluster import carry_out

        try:
            yield from carry_out(self._crew, tasks, work)
        except Lost as error:
            raise Refused(f"{error}; what was written is complete up to here") from None

    @cached_property
    def _crew(self):
        from servo.batch.local_cluster import local

        return self.enter_context(local(self._workers))
