"""The command that repeats a bench, found from what its results say they were made of."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from servo.batch.jobs import RESULTS
from servo.bench import suites
from servo.mistake import Mistake
from servo.report import files
from servo.report.page import Block, versions
from sim import kinds

UNKNOWN = (
    "Its trackers or sequences came from a file of your own; the settings of each run are in "
    f"{RESULTS}/."
)


@dataclass(frozen=True, slots=True)
class Job:
    """What a result was made of."""

    tracker: dict[str, Any]
    version: str
    sequence: dict[str, Any] | None = None


@dataclass(frozen=True, slots=True)
class Kept:
    """One file of results/."""

    job: Job


def command(folder: Path, runs: Sequence[tuple[str, str, int]], *, closed: bool = False) -> Block:
    """How to do it again.

    Args:
        folder: Of the bench.
        runs: Tracker, sequence or scenario, and seed of each run.
        closed: Whether it was in the closed loop.

    Raises:
        Mistake: A result is broken.
    """
    seeds = sorted({seed for _, _, seed in runs})
    jobs = {
        (tracker, name): _job(folder, tracker, name, seed) for tracker, name, seed in runs[::-1]
    }
    told = {job.version for job in jobs.values() if job}
    table = [versions({"servobench": version}) for version in sorted(told)]
    trackers = {tracker: job.tracker for (tracker, _), job in jobs.items() if job}
    words = [_tracker(label, trackers.get(label)) for label in dict.fromkeys(r[0] for r in runs)]
    sequences = {name: job.sequence or {} for (_, name), job in jobs.items() if job}
    suite = suites.CLOSED_LOOP if closed else _suite(list(sequences.values()))
    if suite is None or None in words or seeds != list(range(len(seeds))):
        return Block("Again", [UNKNOWN], tables=table)
    chosen = ",".join(word for word in words if word)
    line = ["servobench", "bench", suite, "--trackers", chosen, "--seeds", str(len(seeds))]
    return Block("Again", tables=table, code=[shlex.join(line)])


def _job(folder: Path, tracker: str, name: str, seed: int) -> Job | None:
    path = folder / RESULTS / tracker / f"{name}-{seed}.json"
    return files.read(path, Kept).job if path.exists() else None


def _tracker(label: str, described: dict[str, Any] | None) -> str | None:
    """The word for --trackers that gives just this label and these settings."""
    if described is None:
        return None
    kind = str(described.get("kind")).rsplit(".", 1)[-1]
    try:
        presets = kinds.presets(suites.TRACKERS, kind)
        for word in (kind, *(f"{kind}:{preset}" for preset in presets)):
            contender = suites.contenders(word)[0]
            if contender.label == label and contender.describe() == described:
                return word
    except (Mistake, kinds.UnknownKind, ImportError):
        pass  # a tracker that this version does not have
    return None


def _suite(described: Sequence[dict[str, Any]]) -> str | None:
    """A suite that has just these sequences, or the folder they are in."""
    for name in suites.SUITES:
        entries = [entry.describe() for entry in suites.suite(name)[0]]
        if len(entries) == len(described) and all(entry in described for entry in entries):
            return name
    folders = {str(d.get("folder")) for d in described}
    return folders.pop() if len(folders) == 1 and "folder" in described[0] else None
