"""The results of a bench: a row for each run, and one for each tracker with intervals and tests."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from servo.output.formats import Made, Number
from servo.output.versions import versions
from sim.types import Array
from tracking.evaluation.statistics import Interval, McNemar, bootstrap, cells, holm, titles
from tracking.evaluation.track_measures import MEASURES
from tracking.files import atomic
from tracking.files.csv_text import csv_text
from tracking.files.json_text import number

DECIDES = "frames_until_loss"
"""Measure compared in McNemar's test, as in the KAMS paper: the longer track is a success."""
RANKS = "auc"
SHEETS = "sheets"
SHOWN = {
    "AUC": "auc", "P20": "precision_20", "error": "mean_error_px", "done": "completed",
    "lost": "lost_auc", "ms": "milliseconds", "reads": "evaluations",
}  # fmt: skip
"""Measures in the table, by the titles of their columns."""
INTERVAL = "AUC"
"""Column whose interval is printed; the files have those of all measures."""
LEGEND = (
    "AUC: success, with its 95 % bootstrap interval; P20: precision at 20 px; error [px]; done: "
    "share never lost;\nlost: ROC area of 1 - confidence; reads: histograms a frame; z, p: McNemar "
    "on frames until loss\nagainst the first, p after Holm"
)
Result = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Row:
    """The results of one tracker over all runs."""

    tracker: str
    runs: int
    means: dict[str, Interval]
    """Means by measure; measures without a value are left out."""
    families: dict[str, float | None]
    """Mean success by family; None if it could not be measured."""
    against_best: McNemar | None
    """McNemar's test of this tracker against the best one; None for the best."""
    p: float
    """The test's p value, corrected for the number of trackers (Holm)."""


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
    best, others = labels[0], labels[1:]
    tests = [compare(by_label[other], by_label[best]) for other in others]
    corrected = holm(np.array([test.p for test in tests])) if tests else np.zeros(0)
    pairs = [(None, 1.0), *zip(tests, corrected.tolist(), strict=True)]
    return [
        Row(label, len(by_label[label]), _means(by_label[label]), _families(by_label[label]), test,
            p)
        for label, (test, p) in zip(labels, pairs, strict=True)
    ]  # fmt: skip


def compare(first: Sequence[Result], second: Sequence[Result], measure: str = DECIDES) -> McNemar:
    """McNemar's test of two trackers on the runs of both: the higher value is a success."""
    a = {(r["sequence"], r["seed"]): r["measures"][measure] for r in first}
    b = {(r["sequence"], r["seed"]): r["measures"][measure] for r in second}
    both = sorted(a.keys() & b.keys())
    return McNemar.of(np.array([a[k] for k in both]), np.array([b[k] for k in both]))


def values(results: Sequence[Result], measure: str) -> Array:
    """The finite values of a measure (n,)."""
    found = [r["measures"].get(measure) for r in results]
    return np.array([v for v in found if v is not None], dtype=float)


def write(results: Sequence[Result], rows: Sequence[Row], folder: Path, command: str) -> list[Path]:
    """Write runs.csv, table.csv and bench.json; their paths.

    Raises:
        OSError: A file cannot be written.
    """
    names = [m.name for m in MEASURES]
    about = ("tracker", "sequence", "family", "seed", "frames")
    runs = [[*(r[k] for k in about), *(r["measures"].get(name) for name in names)]
            for r in results]  # fmt: skip
    head = ["tracker", "runs", *titles(names), "z_against_best", "p_holm"]
    lines = [[r.tracker, r.runs, *cells(map(r.means.get, names)),
              "" if r.against_best is None else r.against_best.z, r.p] for r in rows]  # fmt: skip
    bench = SequenceBench(
        command=command,
        versions=versions(),
        measures={m.name: {"unit": m.unit, "better": m.better.value, "meaning": m.meaning}
                  for m in MEASURES},
        trackers=list(rows),
        runs=[SequenceRun(**result) for result in results],
    )  # fmt: skip
    return [
        atomic.write(folder, "runs.csv", csv_text([*about, *names], runs)),
        atomic.write(folder, "table.csv", csv_text(head, lines)),
        bench.write(folder),
    ]


def _mean(results: Sequence[Result], measure: str) -> float:
    found = values(results, measure)
    return float(found.mean()) if len(found) else -np.inf


def _means(results: Sequence[Result]) -> dict[str, Interval]:
    found = {m.name: values(results, m.name) for m in MEASURES}
    return {name: bootstrap(scores) for name, scores in found.items() if len(scores)}


def _families(results: Sequence[Result]) -> dict[str, float | None]:
    names = dict.fromkeys(r["family"] for r in results)
    return {
        name: number(_mean([r for r in results if r["family"] == name], RANKS)) for name in names
    }
