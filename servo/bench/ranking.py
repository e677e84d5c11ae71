"""The results of a bench: a row for each run, and one for each tracker with intervals and tests.

The unit is the sequence: seeds on one recording are averaged first. A painted sequence is drawn by
its seed, so that each seed is a sequence of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import BeforeValidator

from servo.output.formats import Made, Number
from servo.output.versions import versions
from sim.types import Array
from tracking.evaluation.track_measures import MEASURES
from tracking.files import atomic
from tracking.files.csv_text import csv_text
from tracking.files.json_text import number
from tracking.statistics.comparisons import Interval, McNemar, cells, holm, mean_of, titles

DECIDES = "frames_until_loss"
"""Measure compared in McNemar's test, as in the KAMS paper: the longer track is a success."""
RANKS = "auc"
SHEETS = "sheets"
SHOWN = {
    "AUC": "auc",
    "P20": "precision_20",
    "error": "mean_error_px",
    "done": "completed",
    "lost": "lost_auc",
    "ms": "milliseconds",
    "reads": "evaluations",
}
"""Measures in the table, by the titles of their columns."""
INTERVAL = "AUC"
"""Column whose interval is printed; the files have those of all measures."""
LEGEND = (
    "means over n sequences (each painted one, and each recording over its seeds); AUC: success, "
    "with its 95 %\ninterval; P20: precision at 20 px; error [px]; done: share never lost; lost: "
    "ROC area of 1 - confidence; reads:\nhistograms a frame; z, p: McNemar on frames until loss "
    "against the first, p after Holm over all pairs"
)
UNIT = "sequence"
Result = dict[str, Any]


def _ends_as_nan(means: Any) -> Any:
    """Means from JSON, which has no nan: an end that is missing there is nan here."""
    if not isinstance(means, dict):
        return means
    return {
        name: {k: np.nan if v is None else v for k, v in i.items()} if isinstance(i, dict) else i
        for name, i in means.items()
    }


Means = Annotated[dict[str, Interval], BeforeValidator(_ends_as_nan)]


@dataclass(frozen=True, slots=True)
class Row:
    """The results of one tracker over all runs."""

    tracker: str
    runs: int
    means: Means
    """Means over sequences by measure; measures without a value are left out."""
    families: dict[str, float | None]
    """Mean success by family; None if it could not be measured."""
    against_best: McNemar | None
    """McNemar's test of this tracker against the best one; None for the best."""
    p: float
    """The test's p value, corrected for the number of pairs of trackers (Holm): the best one is
    found in the same runs, so that every pair is compared."""

    @property
    def units(self) -> int:
        """Number of sequences."""
        return self.means[RANKS].units if RANKS in self.means else 0


@dataclass(frozen=True, slots=True)
class SequenceRun:
    """The result of one tracker on one sequence with one seed."""

    tracker: str
    sequence: str
    family: str
    seed: int
    frames: int
    measures: dict[str, Number | None]
    success: list[float]
    precision: list[float]
    drawn: bool = True
    """Whether the sequence is drawn by the seed; else all seeds are runs on one recording."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SequenceBench(Made):
    """bench.json of `servobench bench` on sequences."""

    FILE: ClassVar[str] = "bench.json"
    KIND: ClassVar[str] = "bench"

    measures: dict[str, dict[str, str]]
    """Unit, better direction and meaning of each measure, by name."""
    trackers: list[Row]
    """Trackers in order; the best is the first."""
    runs: list[SequenceRun]


def rows_of(results: Sequence[Result]) -> list[Row]:
    """A row for each tracker; the best is the first."""
    labels = list(dict.fromkeys(r["tracker"] for r in results))
    by_label = {label: [r for r in results if r["tracker"] == label] for label in labels}
    labels.sort(key=lambda label: -_mean(by_label[label], RANKS))
    pairs = [(a, b) for i, b in enumerate(labels) for a in labels[i + 1 :]]
    tests = [compare(by_label[a], by_label[b]) for a, b in pairs]
    corrected = holm(np.array([test.p for test in tests])).tolist()
    against = {
        a: (t, p) for (a, b), t, p in zip(pairs, tests, corrected, strict=True) if b == labels[0]
    }
    return [
        Row(
            label,
            len(by_label[label]),
            _means(by_label[label]),
            _families(by_label[label]),
            *against.get(label, (None, 1.0)),
        )
        for label in labels
    ]


def compare(first: Sequence[Result], second: Sequence[Result], measure: str = DECIDES) -> McNemar:
    """McNemar's test of two trackers on the sequences of both: the higher mean over the seeds of a
    sequence is a success.
    """
    a = _scores(first, measure)
    b = _scores(second, measure)
    both = sorted(a.keys() & b.keys())
    return McNemar.of(np.array([a[k] for k in both]), np.array([b[k] for k in both]))


def values(results: Sequence[Result], measure: str) -> Array:
    """A measure of each sequence (n,): its mean over the seeds that have it."""
    return np.array(list(_scores(results, measure).values()), dtype=float)


def _scores(results: Sequence[Result], measure: str) -> dict[tuple[str, int], float]:
    """Mean of a measure by sequence, and by seed where the seed draws the sequence."""
    found: dict[tuple[str, int], list[float]] = {}
    for r in results:
        value = r["measures"].get(measure)
        if value is not None:
            seed = r["seed"] if r.get("drawn", True) else 0
            found.setdefault((r["sequence"], seed), []).append(value)
    return {unit: float(np.mean(scores)) for unit, scores in found.items()}


def write(results: Sequence[Result], rows: Sequence[Row], folder: Path, command: str) -> list[Path]:
    """Write runs.csv, table.csv and bench.json; their paths.

    Raises:
        OSError: A file cannot be written.
    """
    names = [m.name for m in MEASURES]
    about = ("tracker", "sequence", "family", "seed", "drawn", "frames")
    runs = [
        [*(r.get(k, "") for k in about), *(r["measures"].get(name) for name in names)]
        for r in results
    ]
    head = ["tracker", "runs", "unit", *titles(names), "z_against_best", "p_holm"]
    lines = [
        [
            r.tracker,
            r.runs,
            UNIT,
            *cells(map(r.means.get, names)),
            "" if r.against_best is None else r.against_best.z,
            r.p,
        ]
        for r in rows
    ]
    bench = SequenceBench(
        command=command,
        versions=versions(),
        measures={
            m.name: {"unit": m.unit, "better": m.better.value, "meaning": m.meaning}
            for m in MEASURES
        },
        trackers=list(rows),
        runs=[SequenceRun(**result) for result in results],
    )
    return [
        atomic.write(folder, "runs.csv", csv_text([*about, *names], runs)),
        atomic.write(folder, "table.csv", csv_text(head, lines)),
        bench.write(folder),
    ]


def _mean(results: Sequence[Result], measure: str) -> float:
    found = values(results, measure)
    return float(found.mean()) if len(found) else -np.inf


def _means(results: Sequence[Result]) -> dict[str, Interval]:
    found = {m.name: (values(results, m.name), m.most) for m in MEASURES}
    return {
        name: mean_of(scores, least=0.0, most=most)
        for name, (scores, most) in found.items()
        if len(scores)
    }


def _families(results: Sequence[Result]) -> dict[str, float | None]:
    names = dict.fromkeys(r["family"] for r in results)
    return {
        name: number(_mean([r for r in results if r["family"] == name], RANKS)) for name in names
    }
