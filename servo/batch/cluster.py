"""A local or external cluster: a client, and a watch over its workers."""

from __future__ import annotations

import logging
from collections.abc import Callable, Generator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import dask.config
from distributed import Client

from servo.batch.ended import Lost

DEATHS = 2
"""Most workers that may die at a task; after one more, the task has failed."""
PATIENCE = 20.0
"""Longest wait for a scheduler or its workers [s]."""
TICK = 0.5
"""Interval between two checks of the workers [s]."""
SETTINGS = {
    "distributed.scheduler.allowed-failures": DEATHS,
    "distributed.comm.timeouts.connect": PATIENCE,
    "distributed.worker.daemon": True,
    # These logs are not used, and they grow over thousands of runs.
    "distributed.worker.profile.enabled": False,
    "distributed.admin.log-length": 100,
    "distributed.admin.low-level-log-length": 100,
    "distributed.admin.system-monitor.log-length": 60,
    "distributed.admin.system-monitor.gil.enabled": False,
}
LOGGERS = ("distributed", "distributed.client", "tornado", "asyncio")


@dataclass(frozen=True, slots=True)
class Cluster:
    """A running cluster."""

    client: Client
    name: str
    """Name for messages."""
    watch: Callable[[int], None]
    """Called every `TICK` with the number of workers; raises Lost if none come."""

    def workers(self) -> int:
        """Number of workers now.

        Raises:
            Lost: A worker runs several tasks at once.
        """
        threads: Any = self.client.nthreads()  # a coroutine only in asynchronous clients
        if max(threads.values(), default=1) > 1:
            raise Lost(
                f"{self.name}: a worker has several threads, but a renderer needs a process of its "
                "own; start the workers with --nthreads 1"
            )
        return len(threads)


@contextmanager
def silence() -> Generator[None]:
    """Use our settings of Dask, and keep its loggers off stderr, within the block."""
    for name in LOGGERS:  # Dask silences its loggers only until a cluster closes
        logging.getLogger(name).setLevel(logging.CRITICAL)
    with dask.config.set(SETTINGS):
        yield
