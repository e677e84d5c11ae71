"""Work over processes with Dask: here by default, or on a cluster that the user already has."""

from __future__ import annotations

import logging
import os
import signal
import threading
import traceback
import uuid
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import resource_tracker
from typing import Any, TypeVar

import cv2
import dask.config
from distributed import Client, Future, KilledWorker, LocalCluster, as_completed

from servo.mistake import Mistake

Task = TypeVar("Task")
DEATHS = 2
"""A task at which more workers than this have died is given up."""
PATIENCE = 20.0
"""How long a scheduler is waited for, or workers of it [s]."""
SETTINGS = {
    "distributed.scheduler.allowed-failures": DEATHS,
    "distributed.comm.timeouts.connect": PATIENCE,
    "distributed.worker.daemon": True,
    # Nobody looks at these, and over thousands of runs they grow.
    "distributed.worker.profile.enabled": False,
    "distributed.admin.log-length": 100,
    "distributed.admin.low-level-log-length": 100,
    "distributed.admin.system-monitor.log-length": 60,
    "distributed.admin.system-monitor.gil.enabled": False,
}
LOGGERS = ("distributed", "distributed.client", "tornado")
SILENT = {"DASK_LOGGING__DISTRIBUTED": "critical"}
"""What a worker has to tell comes back with its task."""
ONE_THREAD = {"LP_NUM_THREADS": "0", "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
"""Workers share the processors already."""


@dataclass(frozen=True, slots=True)
class Ended:
    """How a task ended."""

    value: Any
    error: str = ""
    """The traceback of a failure; empty where there was none."""


@contextmanager
def farm(workers: int, address: str | None) -> Generator[Client]:
    """A client of a scheduler: of one that runs already, or of one that is made for this.

    Args:
        workers: Number of processes, where the scheduler is made here.
        address: Such as "tcp://10.0.0.1:8786"; None: here.

    Raises:
        Mistake: There is no scheduler at the address, or its workers run several tasks at once.
    """
    quiet = logging.CRITICAL
    for name in LOGGERS:  # a cluster is silenced only until it closes
        logging.getLogger(name).setLevel(quiet)
    with dask.config.set(SETTINGS):
        if address is None:
            with _deaf_children():  # it is the client that stops them
                cluster = LocalCluster(
                    n_workers=workers, threads_per_worker=1, processes=True,
                    env=ONE_THREAD | SILENT, dashboard_address=":0", silence_logs=quiet,
                )  # fmt: skip
            with cluster, Client(cluster, set_as_default=False) as client:
                yield client
            return
        with _client(address) as client:
            yield client


def _client(address: str) -> Client:
    try:
        client = Client(address, timeout=PATIENCE, set_as_default=False)
        client.wait_for_workers(1, timeout=PATIENCE)
    except (OSError, ValueError) as error:
        raise Mistake(
            f"--scheduler {address}: no scheduler with workers answers there: {error}"
        ) from None
    if max(_threads(client).values()) > 1:
        client.close()
        raise Mistake(
            f"--scheduler {address}: a worker has several threads, but a renderer needs a process "
            "of its own; start the workers with --nthreads 1"
        )
    return client


def carry_out(
    client: Client, tasks: Iterable[Task], work: Callable[[Task], Any]
) -> Iterator[tuple[Task, Ended]]:
    """Do tasks, as many at once as there are workers; the order is that of their ends.

    A worker that dies takes only its own task with it, which another worker then does.

    Raises:
        ConnectionError: The scheduler is gone.
    """
    waiting, session = iter(tasks), uuid.uuid4().hex
    under_way: dict[str, tuple[Task, Future[Any]]] = {}
    ended = as_completed(loop=client.loop)

    def top_up() -> None:
        for _ in range(max(1, len(_threads(client))) - len(under_way)):
            task = next(waiting, None)
            if task is None:
                return
            key = f"servobench-{session}-{uuid.uuid4().hex}"
            future = client.submit(_work_alone, work, task, key=key, pure=False)
            under_way[key] = task, future
            ended.add(future)

    try:
        top_up()
        for future in ended:
            if future.status in ("lost", "pending"):  # its worker died with it: it is done again
                ended.add(future)
                continue
            task, _ = under_way.pop(future.key)
            yield task, _result(future)
            top_up()
    except (OSError, CancelledError) as error:  # whatever was asked of it just then
        raise ConnectionError("the scheduler is gone") from error
    finally:
        for _, future in under_way.values():
            future.cancel()


def _threads(client: Client) -> dict[str, int]:
    found: Any = client.nthreads()  # a coroutine only in asynchronous clients
    return found


def _result(future: Future[Any]) -> Ended:
    if future.status == "finished":
        return Ended(future.result())
    if future.status != "error":  # "cancelled", but not by us
        raise ConnectionError("the scheduler is gone")
    error: Any = future.exception()
    if isinstance(error, KilledWorker):
        return Ended(
            None, f"{DEATHS + 1} workers died of it, one after the other: for want of memory, or "
            "somebody killed them\n"
        )  # fmt: skip
    return Ended(None, "".join(traceback.format_exception(error)))


def _work_alone(work: Callable[[Any], Any], task: Any) -> Any:
    for name, value in ONE_THREAD.items():
        os.environ.setdefault(name, value)
    cv2.setNumThreads(1)
    return work(task)


@contextmanager
def _deaf_children() -> Generator[None]:
    """Processes and threads started in here are not interrupted by Ctrl-C; it waits until the end.

    A terminal sends it to all processes at once, and in a child that is still importing it would
    print a traceback. Without effect where there are no such signals (Windows, other threads).
    """
    main = threading.current_thread() is threading.main_thread()
    if not main or not hasattr(signal, "pthread_sigmask"):
        yield
        return
    resource_tracker.ensure_running()  # the thread that starts it unblocks the signal
    heard = threading.Event()  # by a thread that was there before
    handler = signal.signal(signal.SIGINT, lambda *_: heard.set())
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        signal.signal(signal.SIGINT, handler)
        if heard.is_set():
            signal.raise_signal(signal.SIGINT)
