"""Whether the ranks of loop-v1 are those on recordings: python tests/tools/predicts.py RUNS-OF-BENCH.

RUNS-OF-BENCH is the folder of `servobench evaluate SEQUENCES --trackers ...`. Kendall's tau-b between the mean points and
the mean success AUC of the trackers in both, and between worlds with no and with 100 ms for a picture; intervals from
2,000 bootstrap draws of worlds and recordings.
"""

import sys
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from scipy.stats import kendalltau

from servo.bench.benchmark import load
from servo.bench.row import shipped_rows
from servo.bench.score import standings
from servo.study.sequence_run import TRACKER
from servo.study.store import Store

DRAWS = 2000
LATE = "100"
ANCHOR = "frozen"
"""A tracker that is last everywhere: with it any two lists agree more."""


def aucs(folder: Path) -> dict[str, dict[str, float]]:
    """Return the success AUC of each tracker by recording, the mean over seeds."""
    store = Store(folder)
    store.find()
    found: dict[str, dict[str, list[float]]] = {}
    for record in store.read(store.done):
        of = found.setdefault(record.settings[TRACKER], {})
        of.setdefault(record.subject, []).append(record.measures["auc"])
    return {
        tracker: {recording: float(np.mean(values)) for recording, values in of.items()}
        for tracker, of in found.items()
    }


def table(values: Mapping[str, Mapping[str, float]], names: list[str]) -> np.ndarray:
    """Return the values (names, units) of the units that all have."""
    units = sorted(set.intersection(*(set(values[name]) for name in names)))
    return np.array([[values[name][unit] for unit in units] for name in names])


def tau(first: np.ndarray, second: np.ndarray) -> str:
    """Return Kendall's tau-b of the means of two tables (trackers, units), with its interval."""
    rng = np.random.default_rng(0)

    def drawn(of: np.ndarray) -> np.ndarray:
        return of[:, rng.integers(of.shape[1], size=of.shape[1])].mean(axis=1)

    draws = [kendalltau(drawn(first), drawn(second)).statistic for _ in range(DRAWS)]
    low, high = np.nanpercentile(draws, [2.5, 97.5])
    value = kendalltau(first.mean(axis=1), second.mean(axis=1)).statistic
    return f"{value:.2f} ({low:.2f} to {high:.2f}), {len(first)} trackers"


if __name__ == "__main__":
    rows = shipped_rows(load("loop-v1"))
    points = {s.name: s.points for s in standings(rows)}
    real = aucs(Path(sys.argv[1]))
    both = [name for name in points if name in real and name != ANCHOR]
    means = {name: (list(points[name].values()), list(real[name].values())) for name in both}
    lines = [f"{name:14} {np.mean(a):6.1f} {np.mean(b):.3f}" for name, (a, b) in means.items()]
    lines.append(f"recordings: {tau(table(points, both), table(real, both))}")
    held = [row for row in rows if LATE in row.slow and row.contestant != ANCHOR]
    plain = [
        np.mean([w.held for key, w in row.worlds.items() if key.startswith("reversal")])
        for row in held
    ]
    late = kendalltau(plain, [row.slow[LATE] for row in held]).statistic
    lines.append(f"{LATE} ms: {late:.2f}, {len(held)} trackers")
    sys.stdout.write("\n".join(lines) + "\n")
