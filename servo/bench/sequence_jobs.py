"""The jobs of the papers' claims on sequences; they go when the claims are studies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from servo.bench.ranking import DECIDES
from servo.study.job import Job
from servo.study.sequence_run import (
    PRECISION_CURVE,
    SUCCESS_CURVE,
    Contender,
    Entry,
    Generated,
    Recorded,
    TrackedSequence,
)
from tracking.files.json_text import number
from tracking.statistics.comparisons import McNemar

__all__ = ["Contender", "Entry", "Generated", "Recorded", "SequenceJob", "compare", "track_path"]


@dataclass(frozen=True, slots=True)
class SequenceJob:
    """One tracker on one sequence with one seed."""

    contender: Contender
    entry: Entry
    seed: int

    @property
    def key(self) -> str:
        return f"{self.contender.label}/{self.entry.name}-{self.seed}"

    def describe(self) -> dict[str, Any]:
        return TrackedSequence(self.contender, self.entry).describe() | {"seed": self.seed}

    def run(self, folder: Path) -> dict[str, Any]:
        """Measures and curves; the track is written to DIR/tracks."""
        subject = TrackedSequence(self.contender, self.entry)
        record = subject.perform(Job(0, subject, self.seed), folder)
        measures = {k: number(v) for k, v in record.measures.items()}
        return {
            "tracker": self.contender.label,
            "sequence": record.subject,
            "family": self.entry.name,
            "seed": self.seed,
            "drawn": isinstance(self.entry, Generated),
            "frames": measures.pop("frames"),
            "measures": measures,
            "success": record.series[SUCCESS_CURVE].tolist(),
            "precision": record.series[PRECISION_CURVE].tolist(),
        }


def track_path(folder: Path, key: str) -> Path:
    """The file of a job's track."""
    return folder / "tracks" / f"{key}.csv"


def compare(
    first: Sequence[dict[str, Any]], second: Sequence[dict[str, Any]], measure: str = DECIDES
) -> McNemar:
    """McNemar's test of two trackers on the sequences of both."""
    a = _scores(first, measure)
    b = _scores(second, measure)
    both = sorted(a.keys() & b.keys())
    return McNemar.of(np.array([a[k] for k in both]), np.array([b[k] for k in both]))


def _scores(results: Sequence[dict[str, Any]], measure: str) -> dict[tuple[str, int], float]:
    found: dict[tuple[str, int], list[float]] = {}
    for r in results:
        value = r["measures"].get(measure)
        if value is not None:
            seed = r["seed"] if r.get("drawn", True) else 0
            found.setdefault((r["sequence"], seed), []).append(value)
    return {unit: float(np.mean(scores)) for unit, scores in found.items()}
