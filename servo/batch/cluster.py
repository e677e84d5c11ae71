"""What a local and an external cluster have in common: a client, and a watch over its workers."""

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
"""A task at which more workers than this have died is given up."""
PATIENCE = 20.0
"""Longest wait for a scheduler, or for workers of it [s]."""
TICK = 0.5
"""Interval between two checks of the workers [s]."""
SETTINGS = {
    "distributed.scheduler.allowed-failures": DEATHS,
    "distributed.comm.timeouts.connect": PATIENCE,
    "distributed.worker.daemon": True,
    # Nobody reads these, and over thousands of runs they grow.
    "distributed.worker.profile.enabled": False,
    "distributed.admin.log-length": 100,
    "distributed.admin.low-level-log-length": 100,
    "distributed.admin.system-monitor.log-length": 60,
    "distributed.admin.system-monitor.gil.enabled": False,
}
LOGGERS = ("distributed", "distributed.client", "tornado", "asyncio")


@dataclass(frozen=True, slots=True)
class Cluster:
    """A cluster as the tasks see it."""

    client: Client
    name: str
    """For messages."""
    watch: Callable[[int], None]
    """Called every `TICK` with the number of workers; raises Lost where none come."""

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
    """Dask with our settings, and with nothing but our own sentences on stderr."""
    for name in LOGGERS:  # a cluster is silenced only until it closes
        logging.getLogger(name).setLevel(logging.CRITICAL)
    with dask.config.set(SETTINGS):
        yield
