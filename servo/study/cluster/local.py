"""A cluster of worker processes on this machine; workers that die are replaced."""

import logging
import os
import resource
import signal
import threading
from collections.abc import Generator
from contextlib import contextmanager
from multiprocessing import resource_tracker

from dask.system import CPU_COUNT
from distributed import Client, LocalCluster, Status
from distributed.security import Security
from distributed.system import MEMORY_LIMIT

from servo.mistake import Mistake, Refused
from servo.study.cluster.tasks import ONE_THREAD, Cluster, Patience, reason, silence

LOOPBACK = "127.0.0.1"
SILENT = {"DASK_LOGGING__DISTRIBUTED": "critical"}
"""Environment variables that turn off a worker's logs: errors are returned with the task."""
WORKER_BYTES = 300e6
"""Peak memory of a worker that renders [bytes]."""
WORKERS_A_CORE = 8
"""Most workers for each processor core."""
FILES = 32
"""Open files of the process that controls the workers."""
FILES_A_WORKER = 16
"""Additional open files for each worker."""
WARNINGS = "PYTHONWARNINGS"
LONGEST_START = 60.0
"""Longest time without any worker [s]; one starts in 2 s, in 10 s on a busy machine."""
NO_WORKER = (
    "the worker processes end before they can work; there may be too little memory, or too few "
    "processes or open files allowed (ulimit -a)"
)


def check_workers(workers: int) -> None:
    """Check that this machine can run a number of worker processes. If they need more open files
    than this process may have, raise this limit of the process.

    Raises:
        Mistake: The machine has too little memory (300 MB for each process) or too few processor
            cores (eight processes for each).
        Refused: The system does not allow so many open files.
    """
    by_memory = max(1, int(MEMORY_LIMIT / WORKER_BYTES))
    most = min(by_memory, WORKERS_A_CORE * CPU_COUNT)
    if workers > most:
        raise Mistake(
            f"--workers {workers}: this machine has {MEMORY_LIMIT / 1e9:.1f} GB of memory and "
            f"{CPU_COUNT} cores, and a worker takes {WORKER_BYTES / 1e9:.1f} GB: use at most "
            f"{most} workers, best {min(by_memory, CPU_COUNT)}"
        )
    _allow_files(FILES + FILES_A_WORKER * workers)


def _allow_files(needed: int) -> None:
    """Raise this process's limit of open files, which its children inherit, to at least `needed`.

    Raises:
        Refused: The system does not allow so many.
    """
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft == resource.RLIM_INFINITY or soft >= needed:
        return
    if hard != resource.RLIM_INFINITY and hard < needed:
        raise Refused(
            f"the workers need {needed} open files, and the hard limit is {hard}: use fewer "
            f"--workers, or let root raise this limit (ulimit -Hn {needed})"
        )
    resource.setrlimit(resource.RLIMIT_NOFILE, (needed, hard))


@contextmanager
def local(workers: int) -> Generator[Cluster]:
    """Context manager that starts a Dask cluster of worker processes on this machine, yields it,
    and ends it with the block. Other machines cannot connect to it.

    Raises:
        Mistake: The machine cannot run so many workers.
        Refused: The processes cannot be started, or may not open as many files as they need.
    """
    check_workers(workers)
    with silence():
        try:
            with _deaf_children():  # the client stops the workers
                cluster = LocalCluster(
                    n_workers=0,
                    threads_per_worker=1,
                    processes=True,
                    host=LOOPBACK,
                    protocol="tcp://",
                    # Without certificates that the user has for another cluster.
                    security=Security(require_encryption=False, tls_ca_file=None),
                    dashboard_address=f"{LOOPBACK}:0",
                    worker_dashboard_address=f"{LOOPBACK}:0",
                    memory_limit=int(MEMORY_LIMIT / workers),
                    env=ONE_THREAD | SILENT,
                    silence_logs=logging.CRITICAL,
                )
        except (OSError, RuntimeError) as error:
            raise Refused(
                f"the worker processes cannot be started: {reason(error)}; use one worker, or "
                "remove the cause"
            ) from None
        with cluster, Client(cluster, set_as_default=False) as client:
            cluster.scale(workers)
            patience = Patience(LONGEST_START, NO_WORKER)

            def watch(there: int) -> None:
                replace_dead(cluster, workers)
                patience(there)

            yield Cluster(client, "the local cluster", watch)


def replace_dead(cluster: LocalCluster, workers: int) -> None:
    """Start new workers in place of those that died while they started; Dask itself restarts
    workers that die later.

    Args:
        cluster: The cluster of this machine.
        workers: Number of workers that it should have.
    """
    nannies = list(cluster.workers.items())
    dead = [name for name, nanny in nannies if nanny.status in (Status.closed, Status.failed)]
    for name in dead:
        cluster.workers.pop(name, None)
    if dead:
        cluster.scale(workers)


def _track_resources() -> None:
    """Start multiprocessing's resource tracker without warnings on stderr, and let it ignore SIGHUP
    as it ignores Ctrl-C and TERM.
    """
    before = os.environ.get(WARNINGS)
    os.environ[WARNINGS] = "ignore:resource_tracker"
    handler = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        resource_tracker.ensure_running()
    finally:
        signal.signal(signal.SIGHUP, handler)
        del os.environ[WARNINGS]
        os.environ.update({} if before is None else {WARNINGS: before})


@contextmanager
def _deaf_children() -> Generator[None]:
    """Let processes and threads that start in the block ignore Ctrl-C. This process ignores Ctrl-C
    in the block, and obeys one from that time after the block.

    A terminal sends Ctrl-C to all processes, and a child that is still importing would print a
    traceback. Outside of the main thread the block has no effect.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    _track_resources()  # starting it unblocks the signal
    heard = threading.Event()  # an older thread may receive the signal
    handler = signal.signal(signal.SIGINT, lambda *_: heard.set())
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        signal.signal(signal.SIGINT, handler)
        if heard.is_set():
            signal.raise_signal(signal.SIGINT)
