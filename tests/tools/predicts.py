"""Whether the ranks of a benchmark are those on recordings: python tests/tools/predicts.py [RUNS-OF-BENCH].

Without an argument: Kendall's tau-b of the points in `loop-v2` and the mean overlap in the study `real`, as its table in
tracking/RESULTS.md has it, over all contestants in both and over those of other authors. The interval is over
contestants (Fisher's z with the variance .437 / (n - 4) of Fieller, Hartley and Pearson, "Tests for rank correlation
coefficients I", 1957); the one in brackets over worlds, by the bootstrap, with the recordings as they are.

With it, of `loop-v1`: RUNS-OF-BENCH is the folder of `servobench evaluate SEQUENCES --trackers ...`. Kendall's tau-b between the mean points and
the mean success AUC of the trackers in both, and between worlds with no and with 100 ms for a picture; intervals from
2,000 bootstrap draws of worlds and recordings.
"""

import re
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


OTHERS = {"NanoTrack v2": "nano", "annealed:video": "witness", "mil": "cv_mil"}
"""Names of the study's trackers that have another one in the benchmark."""
STUDY = re.compile(r"## In the loop on real recordings\n(.*?)\nAgreement of", re.DOTALL)
LINE = re.compile(r"^\| `([^`]+)` \| ([\d.]+), ", re.MULTILINE)


def on_recordings() -> dict[str, float]:
    """Return each tracker's mean overlap in the loop on recordings, by its name in the benchmark."""
    text = STUDY.findall(Path("tracking/RESULTS.md").read_text())[0]
    return {OTHERS.get(name, name): float(value) for name, value in LINE.findall(text)}


def over_contestants(value: float, count: int) -> str:
    """Return the interval of Kendall's tau of so many pairs as a text."""
    if count <= 4:
        return "no interval"
    half = 1.96 * np.sqrt(0.437 / (count - 4))
    low, high = np.tanh(np.arctanh(np.clip(value, -0.999, 0.999)) + (-half, half))
    return f"{low:.2f} to {high:.2f}"


def predicted() -> list[str]:
    """Return lines about the order in `loop-v2` and in the study."""
    real = on_recordings()
    table_of = [s for s in standings(shipped_rows(load("loop-v2"))) if s.name in real]
    lines = [f"{s.name:14} {s.score.value:6.1f} {real[s.name]:.2f}" for s in table_of]
    ranked = [s for s in table_of if s.name != ANCHOR]
    for which, of in (
        ("all", ranked),
        (
            "of other authors",
            [s for s in ranked if s.row.division == "CLOSED" or s.name == "cv_mil"],
        ),
    ):
        points = table({s.name: s.points for s in of}, [s.name for s in of])
        overlaps = np.array([[real[s.name]] for s in of])
        value = kendalltau(points.mean(axis=1), overlaps[:, 0]).statistic
        lines.append(
            f"{which}: {over_contestants(value, len(of))} over contestants; worlds: {tau(points, overlaps)}"
        )
    return lines


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


def predicted_by_the_first(folder: Path) -> list[str]:
    """Return lines about the order in `loop-v1`, and on the recordings of a folder."""
    rows = shipped_rows(load("loop-v1"))
    points = {s.name: s.points for s in standings(rows)}
    real = aucs(folder)
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
    return lines


if __name__ == "__main__":
    found = predicted_by_the_first(Path(sys.argv[1])) if sys.argv[1:] else predicted()
    sys.stdout.write("\n".join(found) + "\n")
