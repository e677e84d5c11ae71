"""The executor: does jobs in this process, on workers of this machine, or on a cluster."""

import ctypes
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, suppress
from functools import cached_property, partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TypeVar

import numpy as np

from servo.mistake import Mistake
from servo.study.run import Failure, Job, Record
from servo.study.store import Store

MOST_RUNS = 100_000
"""Most runs of one command that keeps their records in memory."""
TRIED = 5
"""Most different jobs that are tried to reckon how long all take."""
TRYING = 15.0
"""Longest time of that, but for the last of them [s]."""
Task = TypeVar("Task")
Done = TypeVar("Done")


class Workers(ExitStack):
    """Processes that do jobs, started with the first task; used in a `with`."""

    def __init__(self, count: int = 1, scheduler: str | None = None) -> None:
        """Check what the workers need.

        Args:
            count: Number of processes on this machine; 1: work in this process.
            scheduler: Address of a running cluster, which is used instead.

        Raises:
            Mistake: The machine cannot run so many, or the address is wrong.
        """
        super().__init__()
        self.count = count
        self.scheduler = scheduler
        if scheduler is not None:
            from servo.study.cluster.remote import check_address, security_of

            security_of(check_address(scheduler))
        elif count > 1:
            from servo.study.cluster.local import check_workers  # Dask takes a second to import

            check_workers(count)

    def do(
        self, tasks: Iterable[Task], work: Callable[[Task], Done]
    ) -> Iterator[tuple[Task, Done | Failure]]:
        """Do tasks; yields each as it ends.

        Raises:
            ClusterLost: The workers are gone.
            Refused: The processes cannot be started.
        """
        if self.scheduler is None and self.count == 1:
            yield from _one_by_one(tasks, work)
            return
        from servo.study.cluster.tasks import carry_out

        yield from carry_out(self._cluster, tasks, work)

    @cached_property
    def _cluster(self):
        if self.scheduler is not None:
            from servo.study.cluster.remote import remote

            return self.enter_context(remote(self.scheduler))
        from servo.study.cluster.local import local

        return self.enter_context(local(self.count))


def _one_by_one(
    tasks: Iterable[Task], work: Callable[[Task], Done]
) -> Iterator[tuple[Task, Done | Failure]]:
    for task in tasks:
        try:
            done = work(task)
        except Exception as error:
            yield task, Failure.of(error)
        else:
            yield task, done


def execute(
    jobs: Iterable[Job], workers: Workers, folder: Path = Path()
) -> Iterator[tuple[Job, Record | Failure]]:
    """Do jobs; yields each with its record as it ends.

    Args:
        jobs: In the order in which they begin.
        workers: Where they are done.
        folder: Where they may write files of their own.

    Raises:
        ClusterLost: The workers are gone.
        Refused: The processes cannot be started.
    """
    return workers.do(jobs, partial(_run, folder=folder))


def _run(job: Job, folder: Path) -> Record:
    record = job.run(folder)
    give_back_memory()
    return record


def give_back_memory() -> None:
    """Return freed memory to the system, which glibc keeps in pieces: about a megabyte a run."""
    with suppress(AttributeError, OSError):  # another C library
        ctypes.CDLL(None).malloc_trim(0)


def tried(jobs: Sequence[Job]) -> tuple[float, list[tuple[Job, Failure]]]:
    """Do a few of some jobs, at least one, in this process, and keep nothing.

    Returns:
        How long one took [s], mean, and those that failed. Before others, the first one counts
        only if it took all the time: it compiles the hot loops.
    """
    some = jobs[:: -(-len(jobs) // TRIED)]
    spent: list[float] = []
    failed: list[tuple[Job, Failure]] = []
    before = time.monotonic()
    with TemporaryDirectory() as folder:
        for job, end in _one_by_one([some[0], *some], partial(_run, folder=Path(folder))):
            now = time.monotonic()
            spent.append(now - before)
            before = now
            if isinstance(end, Failure):
                failed.append((job, end))
                break
            if sum(spent) > TRYING:
                break
    return float(np.mean(spent[1:] or spent)), failed


def complete(
    jobs: Iterable[Job], store: Store, workers: Workers
) -> Iterator[tuple[Job, Record | Failure]]:
    """Do the jobs that have no record in a store, and keep each as it ends.

    Raises:
        ClusterLost: The workers are gone.
        Refused: The disk is full, or the processes cannot be started.
    """
    missing = (job for job in jobs if job.key not in store.done)
    for job, end in execute(missing, workers, store.folder):
        if isinstance(end, Failure):
            store.fail(job, end)
        else:
            store.add(job, end)
        yield job, end


def check_number(runs: int) -> None:
    """Refuse more runs than the limit.

    Raises:
        Mistake: There are too many.
    """
    if runs > MOST_RUNS:
        raise Mistake(f"these are {runs:,} runs; the limit is {MOST_RUNS:,}")
