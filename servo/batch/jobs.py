"""Jobs with one file a result: a stopped batch goes on where it was."""

from __future__ import annotations

import hashlib
import json
import traceback
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from tracking.files import atomic, reading

RESULTS = "results"
MOST_BYTES = 1_000_000_000


class Job(Protocol):
    """Work that is done in one go, alike every time; it travels between processes."""

    @property
    def key(self) -> str:
        """The name of its result among the others; slashes make folders."""
        ...

    def describe(self) -> dict[str, Any]:
        """All that decides the result, as JSON has it."""
        ...

    def run(self, folder: Path) -> dict[str, Any]:
        """The result, as JSON has it; more may be written to the folder."""
        ...


@dataclass(frozen=True, slots=True)
class Done:
    """How a job ended."""

    job: Job
    result: dict[str, Any] | None
    """None where it failed."""
    error: str = ""
    """The traceback of a failure."""
    refused: OSError | None = None
    """The operating system's error, where that was the failure."""


def attempt(job: Job, folder: Path) -> Done:
    """Do a job, and keep its result in the folder."""
    try:
        result = job.run(folder)
        atomic.write(folder, _name(job), json.dumps(_document(job, result), indent=1) + "\n")
    except OSError as error:
        return Done(job, None, traceback.format_exc(), error)
    except Exception:
        return Done(job, None, traceback.format_exc())
    return Done(job, result)


def known(job: Job, folder: Path) -> Done | None:
    """The result of this very job, if the folder has it whole."""
    try:
        result = _read(job, folder)
    except ValueError:
        return None
    return None if result is None else Done(job, result)


def damaged(jobs: Iterable[Job], folder: Path) -> list[Path]:
    """Files that should hold a result of these jobs, but cannot be read or were changed."""
    found: list[Path] = []
    for job in jobs:
        try:
            _read(job, folder)
        except ValueError:
            found.append(folder / _name(job))
    return found


def _read(job: Job, folder: Path) -> dict[str, Any] | None:
    """The result of this very job; None where there is none, or one of another job.

    Raises:
        ValueError: The file is no result, or not as it was written.
    """
    path = folder / _name(job)
    if not path.exists():
        return None
    try:
        kept = json.loads(reading.text(path, "result", MOST_BYTES))
    except RecursionError as error:
        raise ValueError(str(error)) from None
    if not isinstance(kept, dict) or kept.keys() != {"job", "result", "sha256"}:
        raise ValueError("this is no result")
    if kept["sha256"] != _digest(kept["job"], kept["result"]):
        raise ValueError("this result was changed")
    same = kept["job"] == json.loads(json.dumps(job.describe()))
    return kept["result"] if same else None


def _document(job: Job, result: dict[str, Any]) -> dict[str, Any]:
    described = json.loads(json.dumps(job.describe()))
    digest = _digest(described, json.loads(json.dumps(result)))
    return {"job": described, "result": result, "sha256": digest}


def _digest(described: Any, result: Any) -> str:
    return hashlib.sha256(json.dumps([described, result]).encode()).hexdigest()


def _name(job: Job) -> str:
    return f"{RESULTS}/{job.key}.json"
