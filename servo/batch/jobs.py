"""Jobs whose results are stored in files, so that a stopped batch can be continued."""

from __future__ import annotations

import hashlib
import json
import traceback
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Protocol

from servo.mistake import Mistake
from servo.output.formats import Document, OtherFormat
from tracking.files.json_text import as_json

RESULTS = "results"


class Job(Protocol):
    """A repeatable piece of work; it is sent between processes."""

    @property
    def key(self) -> str:
        """Unique name of its result; slashes make folders."""
        ...

    def describe(self) -> dict[str, Any]:
        """What decides the result beside the versions, which are those of the whole folder."""
        ...

    def run(self, folder: Path) -> dict[str, Any]:
        """Do the job; its result in the types of JSON. It may also write to the folder."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class ResultFile(Document):
    """results/KEY.json: a result and everything that decides it."""

    KIND: ClassVar[str] = "result"

    job: dict[str, Any]
    result: dict[str, Any]
    sha256: str
    """Digest of job and result as JSON."""

    @staticmethod
    def of(job: Job, result: dict[str, Any]) -> ResultFile:
        """The file of a job and its result."""
        described = as_json(job.describe())
        found = as_json(result)
        return ResultFile(job=described, result=found, sha256=_digest(described, found))


@dataclass(frozen=True, slots=True)
class Done:
    """How a job ended."""

    job: Job
    result: dict[str, Any] | None
    """None if the job failed."""
    error: str = ""
    """The traceback of a failure."""
    refused: OSError | None = None
    """The error of the operating system, if that was the failure."""


def attempt(job: Job, folder: Path) -> Done:
    """Do a job and store its result in the folder."""
    try:
        result = job.run(folder)
        ResultFile.of(job, result).write(folder, _name(job))
    except OSError as error:
        return Done(job, None, traceback.format_exc(), error)
    except Exception:
        return Done(job, None, traceback.format_exc())
    return Done(job, result)


def stored(job: Job, folder: Path) -> dict[str, Any] | None:
    """The stored result of a job; None if there is none, or if it belongs to another job.

    Raises:
        Mistake: The file is not a result, or has been changed.
    """
    path = folder / _name(job)
    if not path.exists():
        return None
    try:
        kept = ResultFile.read(path)
    except OtherFormat as error:
        raise Mistake(error.fact) from None
    except Mistake:
        kept = None
    if kept is None or kept.sha256 != _digest(kept.job, kept.result):
        raise Mistake(f"{path}: this result is damaged")
    return kept.result if kept.job == as_json(job.describe()) else None


def _digest(described: Any, result: Any) -> str:
    return hashlib.sha256(json.dumps([described, result]).encode()).hexdigest()


def _name(job: Job) -> str:
    return f"{RESULTS}/{job.key}.json"
