"""Trackers on painted sequences: their jobs, and the tracks they leave."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

from servo.study.job import Job
from servo.study.record import Record
from servo.study.sequence_run import (
    TRACKER,
    TRACKS,
    Contender,
    Entry,
    Generated,
    TrackedSequence,
)
from sim.types import Array
from tracking.evaluation.track_file import read
from tracking.sequences.painted import KINDS as GENERATORS
from tracking.sequences.sequence import Sequence as Painting
from tracking.sequences.sources import PaintedSource
from tracking.trackers import KINDS as TRACKERS


def contender(
    kind: str, preset: str | None = None, label: str | None = None, **settings: Any
) -> Contender:
    """Return a tracker for an experiment; by default its label contains the preset."""
    config = TRACKERS.config(kind, preset, **settings)
    return Contender(label or (kind if preset is None else f"{kind}-{preset}"), config)


@dataclass(frozen=True, slots=True)
class CachedPainting(Generated):
    """A painted sequence whose pictures are kept for the next tracker: painting takes longer."""

    def build(self, seed: int) -> Painting:
        return _painted(self.kind, self.config, seed)


@lru_cache(maxsize=1)
def _painted(kind: str, config: Any, seed: int) -> Painting:
    sequence = Generated(kind, config).build(seed)
    source = sequence.source
    assert isinstance(source, PaintedSource)
    return replace(sequence, source=PaintedSource(cache(source.paint), source.count))


def generated(kind: str, **settings: Any) -> Generated:
    """Return a painted sequence for an experiment."""
    return CachedPainting(kind, GENERATORS.config(kind, **settings))


def sequence_jobs(
    trackers: Sequence[Contender], entries: Sequence[Entry], seeds: Iterable[int]
) -> list[Job]:
    """Return a job for each tracker on each sequence with each seed; those on one sequence follow
    each other.
    """
    return [
        Job(
            0,
            TrackedSequence(tracker, entry),
            seed,
            {TRACKER: tracker.label},
            name=f"{tracker.label}/{entry.name}-{seed}",
        )
        for entry in entries
        for seed in seeds
        for tracker in trackers
    ]


def states_found(folder: Path, run: Record) -> Array:
    """Return the states (frames, 4) of the track that a run has left."""
    track = f"{run.settings[TRACKER]}/{run.settings['family']}-{run.seed}.csv"
    return read(folder / TRACKS / track).states
