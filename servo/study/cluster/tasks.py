"""Runs tasks on a Dask cluster, local or external. Each task is run once, unless its worker dies:
then it is run again.
"""

import logging
import os
import time
import warnings
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import cv2
import dask.config
from distributed import Client, Future, KilledWorker

from servo.closing import closing
from servo.study.run import ClusterLost, Done, Failure, Task, attempt
from sim.files.notices import Notice

DEATHS = 2
"""Number of workers that may die during one task before the next death makes the task fail."""
PATIENCE = 20.0
"""Longest wait for a scheduler or its workers [s]."""
TICK = 0.5
"""Interval between two checks of the workers [s]."""
SETTINGS = {
    "distributed.scheduler.allowed-failures": DEATHS,
    "distributed.comm.timeouts.connect": PATIENCE,
    "distributed.worker.daemon": True,
    # Dask's own logs are not used, and they grow over thousands of runs.
    "distributed.worker.profile.enabled": False,
    "distributed.admin.log-length": 100,
    "distributed.admin.low-level-log-length": 100,
    "distributed.admin.system-monitor.log-length": 60,
    "distributed.admin.system-monitor.gil.enabled": False,
}
ONE_THREAD = {"LP_NUM_THREADS": "0", "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
"""Environment variables of a worker that limit OpenGL in software and numerical libraries to one
thread, because the workers share the processors."""
LOGGERS = ("distributed", "distributed.client", "tornado", "asyncio")


@dataclass(frozen=True, slots=True)
class Cluster:
    """A running Dask cluster: its client, its name in messages, and a function (`watch`) that is
    called with its number of workers about twice a second or more often, and raises ClusterLost if
    no worker comes.
    """

    client: Client
    name: str
    """Name of the cluster in messages."""
    watch: Callable[[int], None]
    """Is called with the number of workers when tasks end, and after each `TICK` in which none
    ends; raises ClusterLost if no worker comes."""

    def workers(self) -> int:
        """Return the present number of the cluster's workers.

        Raises:
            ClusterLost: A worker has several threads.
        """
        threads: Any = self.client.nthreads()  # a coroutine only in asynchronous clients
        if max(threads.values(), default=1) > 1:
            raise ClusterLost(
                f"{self.name}: a worker has several threads, but a renderer needs a process of its "
                "own; start the workers with --nthreads 1"
            )
        return len(threads)


@dataclass(slots=True)
class Patience:
    """A timer that raises ClusterLost when a cluster has had no workers for `longest` seconds;
    `without` is the time without workers so far [s].
    """

    longest: float
    """Longest time without any worker [s]."""
    sentence: str
    """Message of the exception."""
    without: float = 0.0
    """Time without any worker [s], counted in ticks, so that it stops while this process is
    suspended."""

    def __call__(self, there: int) -> None:
        """Add one `TICK` to the time without workers, or reset this time if there are workers;
        `there` is their present number.

        Raises:
            ClusterLost: There has been no worker for `longest` seconds.
        """
        self.without = 0.0 if there else self.without + TICK
        if self.without >= self.longest:
            raise ClusterLost(self.sentence)


@contextmanager
def silence() -> Generator[None]:
    """Context manager that applies the settings of Dask that studies need (`SETTINGS`) in its
    block. It also turns off Dask's log messages on stderr, until this process ends.
    """
    for name in LOGGERS:  # Dask silences its loggers only until a cluster closes
        logging.getLogger(name).setLevel(logging.CRITICAL)
    with dask.config.set(SETTINGS):
        yield


def carry_out(
    cluster: Cluster, tasks: Iterable[Task], work: Callable[[Task], Done]
) -> Iterator[tuple[Task, Done | Failure]]:
    """Do tasks on a cluster, one at a time on each worker; yield each when it ends, with its
    result, or with the failure if it raised an exception.

    If a worker dies, another worker does its task again; the third death during one task makes it a
    failure.

    Args:
        cluster: The cluster.
        tasks: Arguments of `work`, in the order in which they begin.
        work: Function of one task.

    Raises:
        ClusterLost: The scheduler has stopped, has had no workers for a long time, or has a worker
            with several threads.
    """
    waiting = iter(tasks)
    under_way: list[tuple[Task, Future[Done | Failure]]] = []

    def top_up() -> None:
        there = cluster.workers()
        cluster.watch(there)
        for _ in range(max(1, there) - len(under_way)):
            task = next(waiting, None)
            if task is None:
                return
            future = cluster.client.submit(_work_alone, work, task, pure=False)
            under_way.append((task, future))

    def cancel() -> None:
        for _, future in under_way:
            future.cancel()

    with closing(cancel):
        try:
            top_up()
            while under_way:
                for task, future in _ended(under_way):
                    under_way.remove((task, future))
                    yield task, _result(future, cluster.name)
                top_up()
        except (OSError, CancelledError) as error:
            raise ClusterLost(f"{cluster.name} is gone") from error


def _ended(under_way: Sequence[tuple[Task, Future[Done]]]) -> list[tuple[Task, Future[Done]]]:
    """Wait for at most a `TICK` until a task ends; return all tasks that have ended. A task whose
    worker died has not ended: Dask repeats it.
    """
    until = time.monotonic() + TICK
    while time.monotonic() < until and not any(future.done() for _, future in under_way):
        time.sleep(TICK / 100)
    return [pair for pair in under_way if pair[1].done()]


def _result(future: Future[Done | Failure], name: str) -> Done | Failure:
    """Return the result of a task that has ended, or its failure; `name` is the cluster's name for
    messages.

    Raises:
        ClusterLost: The task was cancelled with its cluster, whose name this is.
    """
    if future.status == "finished":
        return future.result()
    if future.status != "error":
        raise ClusterLost(f"{name} is gone")
    error: Any = future.exception()
    if isinstance(error, KilledWorker):
        return Failure(
            f"{DEATHS + 1} workers died during this task, one after the other: there is too "
            "little memory, or they were killed\n",
        )
    return Failure.of(error)


def _work_alone(work: Callable[[Task], Done], task: Task) -> Done | Failure:
    """Do a task in this worker process, with one thread for numerical libraries and without the
    notices that the process which began the study has printed; return the result or the failure.
    """
    for name, value in ONE_THREAD.items():
        os.environ.setdefault(name, value)
    cv2.setNumThreads(1)
    warnings.simplefilter("ignore", Notice)  # the process that began the study has printed them
    return attempt(work, task)


def reason(error: BaseException) -> str:
    """Return the message of an exception's root cause; if it has none, that of the nearest
    exception above it in the chain of causes.

    For an OSError as root cause, it is the system's text alone, such as "No space left on device";
    if no exception has a message, it is the name of the root cause's type.
    """
    message = str(error)
    while error.__cause__ is not None:
        error = error.__cause__
        message = str(error) or message
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    return message or type(error).__name__
