"""Jobs with one file a result: a stopped batch goes on where it was."""

from __future__ import annotations

import json
import math
import traceback
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

RESULTS = "results"


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


def attempt(job: Job, folder: Path) -> Done:
    """Do a job, and keep its result in the folder."""
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


def known(job: Job, folder: Path) -> Done | None:
    """The result of this very job, if the folder has it."""
    try:
        kept = json.loads(_path(job, folder).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    same = kept.get("job") == json.loads(json.dumps(job.describe()))
    return Done(job, kept["result"]) if same and kept.get("result") is not None else None


def _path(job: Job, folder: Path) -> Path:
    return folder / RESULTS / f"{job.key}.json"


def number(value: float) -> float | None:
    """JSON has neither infinity nor nan: null."""
    return value if math.isfinite(value) else None
