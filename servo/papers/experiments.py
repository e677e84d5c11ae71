"""The jobs of experiments: trackers on painted sequences, and functions of the seed."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

from servo.bench.sequence_jobs import Contender, Entry, Generated, SequenceJob
from servo.bench.suites import GENERATORS, TRACKERS
from servo.papers.groups import Result
from tracking.sequences.sequence import Sequence as Painting
from tracking.sequences.sources import Painted


@dataclass(frozen=True, slots=True)
class Experiment:
    """A job that is a function of the seed."""

    name: str
    about: dict[str, Any]
    """What else decides the result."""
    function: Callable[[int], Result]
    seed: int

    @property
    def key(self) -> str:
        return f"{self.name}/{self.seed}"

    def describe(self) -> dict[str, Any]:
        return self.about | {"seed": self.seed}

    def run(self, folder: Path) -> Result:
        del folder
        return self.function(self.seed)


def contender(
    kind: str, preset: str | None = None, label: str | None = None, **settings: Any
) -> Contender:
    """A tracker for an experiment; by default its label contains the preset."""
    config = TRACKERS.config(kind, preset, **settings)
    return Contender(label or (kind if preset is None else f"{kind}-{preset}"), config)


@dataclass(frozen=True, slots=True)
class Kept(Generated):
    """A painted sequence whose pictures are kept for the next tracker: painting takes longer."""

    def build(self, seed: int) -> Painting:
        return _kept(self.kind, self.config, seed)


@lru_cache(maxsize=1)
def _kept(kind: str, config: Any, seed: int) -> Painting:
    sequence = Generated(kind, config).build(seed)
    source = sequence.source
    assert isinstance(source, Painted)
    return replace(sequence, source=Painted(cache(source.paint), source.count))


def generated(kind: str, **settings: Any) -> Generated:
    """A painted sequence for an experiment."""
    return Kept(kind, GENERATORS.config(kind, **settings))


def sequence_jobs(
    trackers: Sequence[Contender], entries: Sequence[Entry], seeds: Iterable[int]
) -> list[SequenceJob]:
    """Each tracker on each sequence with each seed; those on one sequence follow each other."""
    return [SequenceJob(t, entry, s) for entry in entries for s in seeds for t in trackers]
