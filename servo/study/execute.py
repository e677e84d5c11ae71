"""Executes jobs in this process, in worker processes of this machine, or on a Dask cluster."""

import ctypes
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, suppress
from functools import cached_property, partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from servo.mistake import Mistake
from servo.study.run import Done, Failure, Job, Record, Task, attempt
from servo.study.store import Store

MOST_RUNS = 100_000
"""Most runs of one command that keeps their records in memory."""
TRIED = 5
"""Most different jobs that are run to estimate the time of all jobs."""
TRYING = 15.0
"""Time after which no other job is begun for this estimate [s]."""


class Workers(ExitStack):
    """Context manager of the worker processes that do tasks: `count` processes on this machine,
    which start with the first task and end with the block (with a count of 1, this process does
    the tasks); or, if the address of a `scheduler` is given, the workers of that running Dask
    cluster, to which this process is connected from the first task to the end of the block.
    """

    def __init__(self, count: int = 1, scheduler: str | None = None) -> None:
        """Check the number of workers or the cluster's address; no process is started yet.

        Args:
            count: Number of processes on this machine; 1: tasks are done in this process.
            scheduler: Address of the scheduler of a running Dask cluster, which is used instead.

        Raises:
            Mistake: The machine cannot run so many processes, the address is wrong, or Dask's
                configuration files or TLS settings cannot be used.
            Refused: The system does not allow as many open files as the processes need.
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
        """Do tasks; yield each with its result, or with the failure if it raised an exception, in
        the order in which they end. With a count of 1 and without a scheduler they are done in
        this process, one after the other; otherwise in worker processes, in parallel.

        Args:
            tasks: Arguments of `work`, in the order in which they begin.
            work: Function of one task; for worker processes, function and tasks are pickled.

        Raises:
            ClusterLost: The cluster has stopped working, or one of its workers has several threads.
            Mistake: No Dask scheduler with workers answers at the given address.
            Refused: The processes cannot be started.
        """
        if self.scheduler is None and self.count == 1:
            yield from ((task, attempt(work, task)) for task in tasks)
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


def execute(
    jobs: Iterable[Job], workers: Workers, folder: Path = Path()
) -> Iterator[tuple[Job, Record | Failure]]:
    """Run jobs; yield each, in the order in which they end, with the record of its results or with
    its failure.

    Args:
        jobs: The jobs, in the order in which they begin.
        workers: The worker processes that run them.
        folder: Folder into which jobs may write files of their own; by default the working
            directory.

    Raises:
        ClusterLost: The Dask cluster has stopped working, or one of its workers has several
            threads.
        Mistake: No Dask scheduler with workers answers at the address of `workers`.
        Refused: The processes cannot be started.
    """
    return workers.do(jobs, partial(_run, folder=folder))


def _run(job: Job, folder: Path) -> Record:
    """Run a job, give the memory that it used back to the system, and return its record; the job
    may write files into the folder.
    """
    record = job.run(folder)
    with suppress(AttributeError, OSError):  # of a C library without malloc_trim
        ctypes.CDLL(None).malloc_trim(0)  # glibc would keep about 1 MB a run
    return record


def tried(jobs: Sequence[Job]) -> tuple[float, list[tuple[Job, Failure]]]:
    """Measure the time of a job: run up to five jobs, evenly spaced in the list, in this process,
    the first of them twice. Their records are dropped. No job begins once 15 s are spent, or after
    a job that failed.

    Args:
        jobs: All jobs, at least one.

    Returns:
        Mean time of a job [s], and a list with the failed job and its failure, empty if none
        failed. The time of the very first run, which compiles code, counts only if it is the only
        one.
    """
    some = jobs[:: -(-len(jobs) // TRIED)]
    spent: list[float] = []
    with TemporaryDirectory() as folder:
        for job in [some[0], *some]:
            begin = time.monotonic()
            end = attempt(partial(_run, folder=Path(folder)), job)
            spent.append(time.monotonic() - begin)
            if isinstance(end, Failure):
                return float(np.mean(spent[1:] or spent)), [(job, end)]
            if sum(spent) > TRYING:
                break
    return float(np.mean(spent[1:] or spent)), []


def complete(
    jobs: Iterable[Job], store: Store, workers: Workers
) -> Iterator[tuple[Job, Record | Failure]]:
    """Run the jobs that have no record yet in a study's folder, and store there each record, and
    the failures up to the number that `Store.fail` keeps.

    Args:
        jobs: The jobs; those whose key is in `store.done` are skipped.
        store: The study's folder, open for writing.
        workers: The worker processes that run the jobs.

    Yields:
        Each job that was run, when it ends, with its record or its failure.

    Raises:
        ClusterLost: The Dask cluster has stopped working, or one of its workers has several
            threads.
        Mistake: A worker has other versions of packages or other source code, the database is
            damaged, or no Dask scheduler with workers answers at the address.
        Refused: The disk is full, a file cannot be written, the machine had no room left in a job
            (`Failure.full`), or the processes cannot be started.
    """
    missing = (job for job in jobs if job.key not in store.done)
    for job, end in execute(missing, workers, store.folder):
        if isinstance(end, Failure):
            store.fail(job, end)
        else:
            store.add(job, end)
        yield job, end


def check_number(runs: int) -> None:
    """Check that a command makes at most 100,000 runs, whose records fit into memory.

    Raises:
        Mistake: `runs`, the number of runs, is larger.
    """
    if runs > MOST_RUNS:
        raise Mistake(
            f"this command would make {runs:,} runs; the limit is {MOST_RUNS:,}: make fewer at a "
            "time"
        )
