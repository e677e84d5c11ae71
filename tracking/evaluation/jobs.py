"""Jobs over processes, one file a result: a stopped batch goes on where it was."""

from __future__ import annotations

import json
import math
import multiprocessing
import os
import traceback
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import cv2

RESULTS = "results"
AHEAD = 2
"""Jobs that wait for each worker; more would only take memory."""


class Job(Protocol):
    """Work that is done in one go, alike every time; it travels between processes."""

    @property
    def key(self) -> str:
        """The name of its result among the others; slashes make folders."""
        ...

    def describe(self) -> dict[str, Any]:
        """All that decides the result, in words that JSON has."""
        ...

    def run(self, folder: Path) -> dict[str, Any]:
        """The result, in words that JSON has; more may be written to the folder."""
        ...


@dataclass(frozen=True, slots=True)
class Done:
    """How a job ended."""

    job: Job
    result: dict[str, Any] | None
    """None where it failed."""
    error: str = ""
    """The traceback of a failure."""


def run_all(jobs: Sequence[Job], folder: Path, workers: int) -> Iterator[Done]:
    """Run what has no result yet; the others give the result they have. The order is that of ends.

    Args:
        jobs: With different keys.
        folder: Where results are kept.
        workers: Number of processes; 1: in this one.
    """
    todo: list[Job] = []
    for job in jobs:
        known = _known(job, folder)
        if known is None:
            todo.append(job)
        else:
            yield Done(job, known)
    if workers == 1:
        yield from (_attempt(job, folder) for job in todo)
        return
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, mp_context=context, initializer=alone) as pool:
        waiting: set[Future[Done]] = set()
        try:
            for job in todo:
                if len(waiting) >= AHEAD * workers:
                    ended, waiting = wait(waiting, return_when=FIRST_COMPLETED)
                    yield from (future.result() for future in ended)
                waiting.add(pool.submit(_attempt, job, folder))
            while waiting:
                ended, waiting = wait(waiting, return_when=FIRST_COMPLETED)
                yield from (future.result() for future in ended)
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


def alone() -> None:
    """One thread for each worker: the workers share the processors already."""
    os.environ["LP_NUM_THREADS"] = "0"
    cv2.setNumThreads(1)


def _attempt(job: Job, folder: Path) -> Done:
    try:
        result = job.run(folder)
    except Exception:
        return Done(job, None, traceback.format_exc())
    path = _path(job, folder)
    path.parent.mkdir(parents=True, exist_ok=True)
    text = json.dumps({"job": job.describe(), "result": result}, indent=1)
    # Written aside and renamed, so that a killed batch leaves no half of a result.
    aside = path.with_suffix(".part")
    aside.write_text(text + "\n", encoding="utf-8")
    aside.replace(path)
    return Done(job, result)


def _known(job: Job, folder: Path) -> dict[str, Any] | None:
    """The result of this very job, if there is one."""
    try:
        kept = json.loads(_path(job, folder).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    same = kept.get("job") == json.loads(json.dumps(job.describe()))
    return kept.get("result") if same else None


def _path(job: Job, folder: Path) -> Path:
    return folder / RESULTS / f"{job.key}.json"


def number(value: float) -> float | None:
    """JSON has neither infinity nor nan: null."""
    return value if math.isfinite(value) else None
