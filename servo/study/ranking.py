"""The ranking of trackers on sequences: means with 95 % intervals, and tests against the best one.

The independent unit is the sequence: the results of several seeds on one recording are averaged
first. A painted sequence is drawn from its seed, so each seed counts as another sequence.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from servo.study.run import Record, grouped_by
from servo.study.sequence_run import TRACKER
from sim.types import Array
from tracking.evaluation.track_measures import MEASURES
from tracking.files.csv_text import csv_text
from tracking.statistics.comparisons import Interval, McNemar, cells, mean_of, pairs_of, titles

DECIDES = "frames_until_loss"
"""Measure compared in McNemar's test, as in the KAMS paper: the longer track is a success."""
RANKS = "auc"
"""Measure whose mean orders the trackers."""
SHOWN = {
    "AUC": "auc",
    "late": "auc_late_3",
    "EO": "expected_overlap",
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
    "with its 95 %\ninterval; late: the same with the estimate of three frames before; EO: "
    "expected overlap; P20: precision at\n20 px; error [px]; done: share never lost; lost: ROC "
    "area of 1 - confidence; reads: histograms a frame;\nz, p: McNemar on frames until loss "
    "against the first, p after Holm over all pairs"
)
UNIT = "sequence"


@dataclass(frozen=True, slots=True)
class Rank:
    """The results of one tracker over all of its runs: its mean measures by name; its mean area
    under the success curve by recording, or by kind of painted sequence (`families`; None without
    a value); and McNemar's test of it against the best tracker (None for the best), with the p
    value after Holm's correction.
    """

    tracker: str
    """Label of the tracker."""
    runs: int
    """Number of runs."""
    means: dict[str, Interval]
    """Means over sequences by measure; measures without a value are left out."""
    families: dict[str, float | None]
    """Mean area under the success curve by name of the recording, or of the kind of painted
    sequence, such as "clutter-a"; None if it has no value."""
    against_best: McNemar | None
    """McNemar's test of this tracker against the best one; None for the best."""
    p: float
    """The test's p value, corrected for the number of pairs of trackers (Holm): the best one is
    found in the same runs, so that every pair is compared. It is 1 for the best."""

    @property
    def units(self) -> int:
        """Return the number of sequences over which the mean area under the success curve is taken;
        0 if no run has a value.
        """
        return self.means[RANKS].units if RANKS in self.means else 0


def ranked(records: Sequence[Record]) -> list[Rank]:
    """Return the results of each tracker, ordered by the mean area under the success curve over
    sequences, the best first; trackers without a value are last.

    Args:
        records: Records of runs of trackers on sequences, each with the tracker's label in its
            settings.
    """
    by_label = grouped_by(records, lambda record: str(record.settings[TRACKER]))
    labels = sorted(by_label, key=lambda label: -_mean(by_label[label]))
    pairs = pairs_of(labels, lambda best, other: compare(by_label[other], by_label[best]))
    against = {other: (test, p) for best, other, test, p in pairs if best == labels[0]}
    return [
        Rank(
            label,
            len(by_label[label]),
            _means(by_label[label]),
            _families(by_label[label]),
            *against.get(label, (None, 1.0)),
        )
        for label in labels
    ]


def compare(first: Sequence[Record], second: Sequence[Record], measure: str = DECIDES) -> McNemar:
    """Compare two trackers by McNemar's test on the sequences on which both have a value; the
    higher value wins.

    Args:
        first: Runs of the first tracker on sequences.
        second: Runs of the second tracker.
        measure: Name of a measure of which more is better, by default the number of frames until
            the target is lost. A recording counts once, with the mean over its seeds, a painted
            (synthetic) sequence once for each seed; runs without a finite value are left out.
    """
    a = _scores(first, measure)
    b = _scores(second, measure)
    both = sorted(a.keys() & b.keys())
    return McNemar.of(np.array([a[k] for k in both]), np.array([b[k] for k in both]))


def values(records: Sequence[Record], measure: str) -> Array:
    """Return the values (n,) of a measure on n sequences, in the measure's unit. The value on a
    recording is the mean over its seeds; of a painted (synthetic) sequence each seed counts as a
    sequence of its own. Sequences without a finite value are left out.
    """
    return np.array(list(_scores(records, measure).values()), dtype=float)


def table_csv(ranks: Sequence[Rank]) -> str:
    """Return a CSV text with a line for each tracker, in the order of `ranks`: label, number of
    runs, kind of the independent unit ("sequence"), mean of each measure over sequences with the
    ends of its 95 % interval and the number of sequences, and z and corrected p value of McNemar's
    test against the best tracker, whose own line has no z and p = 1.
    """
    names = [m.name for m in MEASURES]
    head = [TRACKER, "runs", "unit", *titles(names), "z_against_best", "p_holm"]
    lines = [
        [
            r.tracker,
            r.runs,
            UNIT,
            *cells(map(r.means.get, names)),
            "" if r.against_best is None else r.against_best.z,
            r.p,
        ]
        for r in ranks
    ]
    return csv_text(head, lines)


def _scores(records: Sequence[Record], measure: str) -> dict[tuple[str, int], float]:
    """Return the mean of a measure by name of the sequence, and by seed if the sequence is painted;
    the seed of recordings is 0.
    """
    finite = [r for r in records if np.isfinite(r.measures.get(measure, np.nan))]
    found = grouped_by(finite, lambda r: (r.subject, r.seed if r.settings["drawn"] else 0))
    return {at: float(np.mean([r.measures[measure] for r in own])) for at, own in found.items()}


def _mean(records: Sequence[Record]) -> float:
    """Return the mean area under the success curve over sequences; -inf if no run has a value."""
    found = values(records, RANKS)
    return float(found.mean()) if len(found) else -np.inf


def _means(records: Sequence[Record]) -> dict[str, Interval]:
    """Return the mean of each measure over sequences, by name of the measure; measures without a
    value are left out.
    """
    found = {m.name: (values(records, m.name), m.most) for m in MEASURES}
    return {
        name: mean_of(scores, least=0.0, most=most)
        for name, (scores, most) in found.items()
        if len(scores)
    }


def _families(records: Sequence[Record]) -> dict[str, float | None]:
    """Return the mean area under the success curve by name of the recording, or of the kind of
    painted sequence; None without a value.
    """
    names = dict.fromkeys(r.settings["family"] for r in records)
    means = {name: _mean([r for r in records if r.settings["family"] == name]) for name in names}
    return {name: mean if np.isfinite(mean) else None for name, mean in means.items()}
