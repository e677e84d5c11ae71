"""Which sign of a lost target carries over to recordings that had no part in its choice:
python tests/tools/loss_signals.py FOLDER [OTHER-FOLDER].

`annealed` with its defaults follows the target of each recording in FOLDER (`SEEDS`). Beside it, and without an influence
on it, the signs of each picture are written down. The rule, written before the first run:

- Off the target is a picture without the target, or with an overlap of the boxes below 0.1.
- plain: the distance of colours, as the tracker reports it. It has no constants to fit.
- shipped: the three signs of `:video` (distance, likeness to the first view, spread of the particles) with its four weights.
- refit: the same signs, their weights fitted by logistic regression.
- target: signs in units of this target: the distance less the median of its first `USUAL` pictures; the distance and the
  likeness on the place from what they were around the target in the first picture to what they were on it (0 to 1); and
  the distance less the smallest one around the place now. Weights fitted in the same way.
- All but plain are smoothed over 0.15 s, as `:video` is. Weights are fitted with one recording left out, for each in turn;
  each recording counts alike, and in it the pictures on and off the target do. The figures are those of the recording
  that was left out.
- Told are the area under the ROC curve, where a recording has pictures of both kinds, and, at the threshold that calls
  2 % of the other recordings' pictures with an overlap above 0.5 lost, that share and the share of pictures off the target
  that are called lost. The unit of the intervals is the recording.
- A signal carries over if the interval of its area less that of `plain` is above 0, and its mean area is at least 0.90. It
  replaces the plain one only then; if the interval holds 0, the plain one stays.
- OTHER-FOLDER is read once, at the end, with the weights and thresholds of all recordings in FOLDER.
"""

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import minimize
from scipy.stats import mannwhitneyu

import tracking
from sim.types import Frame
from tracking.appearance.views import Views
from tracking.evaluation.track_measures import ON_TARGET, box_overlaps, seen_in
from tracking.recognition import (
    BIAS,
    BY_DISTANCE,
    BY_LIKENESS,
    BY_SPREAD,
    MEMORY,
    MOST_SIGN,
    _spread,
)
from tracking.sequences.quadrilateral import boxes
from tracking.sequences.sequence import Sequence, read_all
from tracking.types import State

SEEDS = range(4000, 4003)
"""No constant of a tracker was chosen with these."""
RATE = 30.0
USUAL = 15
"""Pictures from which the usual distance of a target is taken: half a second."""
AROUND = 16
"""Places around the target, one size of it away."""
FALSE = 0.02
"""Share of pictures with the target that may be called lost."""
GOOD = 0.5
"""An overlap above this is certainly on the target."""
RIDGE = 1e-3
"""Weight of the squared weights in a fit, which keeps them finite."""
DRAWS = 2000
SIGNS = {"plain": (0,), "refit": (0, 1, 2), "target": (3, 4, 5, 6)}


@dataclass(frozen=True, slots=True)
class Run:
    """The signs of all pictures but the first, and what is true."""

    name: str
    signs: np.ndarray
    """Distance, likeness, spread, four signs of this target (n, 7)."""
    overlaps: np.ndarray
    """Intersection over union (n,); nan without the target."""

    @property
    def off(self) -> np.ndarray:
        """Pictures off the target (n,)."""
        return ~(self.overlaps >= ON_TARGET)


def around(state: State, size: float) -> np.ndarray:
    """Return the states (`AROUND`, 4) around a state."""
    angles = np.linspace(0, 2 * np.pi, AROUND, endpoint=False)
    found = np.tile(state.vector, (AROUND, 1))
    found[:, :2] += size * state.scale * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return found


def followed(sequence: Sequence, seed: int) -> Run:
    """Return the signs of a recording."""
    tracker = tracking.create("annealed", seed=seed)
    region = sequence.region
    size = float(np.sqrt(region.width * region.height))
    rows: list[list[float]] = []
    corners = []
    at = []
    usual: list[float] = []
    for index, picture in enumerate(sequence.source):
        if picture.image is None:
            continue
        frame = Frame(picture.image, picture.time, index)
        if index == 0:
            tracker.start(frame, region, sequence.start)
            model = tracker._model
            views = Views(model.label(frame.image).image, region, sequence.start, 1)
            state = sequence.start
        else:
            found = tracker.update(frame)
            state = found.state
        image = model.label(frame.image)
        blurred = views.blurred(image.image)
        here = state.vector[None]
        near = around(state, size)
        distance = float(model.distances(image, here)[0])
        likeness = float(views.likeness(blurred, here)[0])
        beside = model.distances(image, near)
        if index == 0:
            first = distance, float(np.median(beside))
            alike = likeness, float(np.median(views.likeness(blurred, near)))
            continue
        if len(usual) < USUAL:
            usual.append(distance)
        rows.append(
            [
                distance,
                likeness,
                _spread(tracker._cloud, state),
                distance - float(np.median(usual)),
                (distance - first[0]) / max(first[1] - first[0], 0.1),
                (alike[0] - likeness) / max(alike[0] - alike[1], 0.1),
                distance - float(np.min(beside)),
            ]
        )
        corners.append(found.outline(region))
        at.append(index)
    kept = [index < len(sequence.truth) for index in at]
    truth = sequence.truth[np.array(at)[kept]]
    seen = seen_in(truth)
    overlaps = np.full(len(truth), np.nan)
    overlaps[seen] = box_overlaps(boxes(np.stack(corners)[kept][seen]), boxes(truth[seen]))
    return Run(sequence.name, np.array(rows)[kept], overlaps)


def smoothed(logits: np.ndarray) -> np.ndarray:
    """Return the sums of signs, clipped and smoothed over time as `:video` does."""
    keep = np.exp(-1 / (RATE * MEMORY))
    found = np.clip(logits, -MOST_SIGN, MOST_SIGN)
    for i in range(1, len(found)):
        found[i] = keep * found[i - 1] + (1 - keep) * found[i]
    return found


def fitted(runs: list[Run], columns: tuple[int, ...]) -> np.ndarray:
    """Return the weights, the bias last, of a logistic regression of being off the target."""
    rows, labels, weights = [], [], []
    for name in sorted({run.name for run in runs}):
        signs = np.vstack([run.signs for run in runs if run.name == name])[:, columns]
        off = np.concatenate([run.off for run in runs if run.name == name])
        for label in (False, True):
            if (off == label).any():
                rows.append(signs[off == label])
                labels.append(np.full(len(rows[-1]), float(label)))
                weights.append(np.full(len(rows[-1]), 1 / len(rows[-1])))
    x, y, w = np.vstack(rows), np.concatenate(labels), np.concatenate(weights)
    middle, scale = x.mean(axis=0), x.std(axis=0) + 1e-9
    z = np.column_stack([(x - middle) / scale, np.ones(len(x))])

    def loss(b: np.ndarray) -> float:
        return float(w @ np.logaddexp(0, (1 - 2 * y) * (z @ b)) / w.sum() + RIDGE * b[:-1] @ b[:-1])

    b = minimize(loss, np.zeros(z.shape[1]), method="BFGS").x
    return np.append(b[:-1] / scale, b[-1] - (b[:-1] / scale) @ middle)


def signals(runs: list[Run], training: list[Run]) -> dict[str, tuple[list[np.ndarray], float]]:
    """Return the signals of runs, and the threshold of each, by name."""

    def both(of) -> tuple[list[np.ndarray], float]:
        on = [of(run)[run.overlaps > GOOD] for run in training]
        share = np.concatenate([np.full(len(part), 1 / max(len(part), 1)) for part in on])
        values = np.concatenate(on)
        order = np.argsort(values)
        place = np.searchsorted(np.cumsum(share[order]), (1 - FALSE) * share.sum())
        return [of(run) for run in runs], float(values[order][min(place, len(order) - 1)])

    def shipped(run: Run) -> np.ndarray:
        distance, likeness, spread = run.signs[:, :3].T
        return smoothed(
            -(BIAS + BY_DISTANCE * distance + BY_LIKENESS * likeness + BY_SPREAD * spread)
        )

    found = {"plain": both(lambda run: run.signs[:, 0]), "shipped": both(shipped)}
    for name in ("refit", "target"):
        b = fitted(training, SIGNS[name])
        columns = SIGNS[name]
        found[name] = both(lambda run, b=b, c=columns: smoothed(run.signs[:, c] @ b[:-1] + b[-1]))
    return found


def judged(runs: list[Run], of: dict[str, tuple[list[np.ndarray], float]]) -> dict[str, np.ndarray]:
    """Return ROC area, share lost on the target, share lost off it, the mean over the seeds."""
    found = {}
    for name, (values, threshold) in of.items():
        rows = []
        for run, value in zip(runs, values, strict=True):
            off, on = value[run.off], value[~run.off]
            area = (
                mannwhitneyu(off, on).statistic / (len(off) * len(on))
                if len(off) and len(on)
                else np.nan
            )
            good = value[run.overlaps > GOOD]
            rows.append(
                [
                    area,
                    np.mean(good > threshold) if len(good) else np.nan,
                    np.mean(off > threshold) if len(off) else np.nan,
                ]
            )
        table = np.array(rows)
        seen = np.isfinite(table)
        found[name] = np.where(
            seen.any(axis=0), np.nansum(table, axis=0) / np.maximum(seen.sum(axis=0), 1), np.nan
        )
    return found


def interval(values: np.ndarray) -> str:
    """Return the mean over recordings with its 95 % interval."""
    values = values[np.isfinite(values)]
    draws = np.random.default_rng(0).choice(values, (DRAWS, len(values))).mean(axis=1)
    low, high = np.percentile(draws, [2.5, 97.5])
    return f"{values.mean():.3f} ({low:.3f} to {high:.3f}, {len(values)})"


def tell(title: str, results: dict[str, dict[str, np.ndarray]]) -> None:
    """Print the areas by recording, and the means."""
    names = list(next(iter(results.values())))
    lines = [title, f"{'':24}" + "".join(f"{name:>10}" for name in names)]
    for recording, of in results.items():
        lines.append(f"{recording:24}" + "".join(f"{of[name][0]:10.3f}" for name in names))
    for column, meaning in enumerate(("ROC area", "lost on the target", "lost off the target")):
        for name in names:
            values = np.array([of[name][column] for of in results.values()])
            lines.append(f"{meaning}, {name}: {interval(values)}")
    for name in names[1:]:
        change = np.array([of[name][0] - of["plain"][0] for of in results.values()])
        lines.append(f"area of {name} less plain: {interval(change)}")
    sys.stdout.write("\n".join(lines) + "\n")


def all_runs(folder: str) -> list[Run]:
    """Return the runs of all recordings in a folder."""
    found = []
    for sequence in read_all(Path(folder), RATE):
        found += [followed(sequence, seed) for seed in SEEDS]
        sys.stderr.write(f"{sequence.name}\n")
    return found


if __name__ == "__main__":
    runs = all_runs(sys.argv[1])
    results = {}
    for name in dict.fromkeys(run.name for run in runs):
        left = [run for run in runs if run.name == name]
        others = [run for run in runs if run.name != name]
        results[name] = judged(left, signals(left, others))
    tell("one recording left out", results)
    if len(sys.argv) > 2:
        others = all_runs(sys.argv[2])
        results = {}
        for name in dict.fromkeys(run.name for run in others):
            left = [run for run in others if run.name == name]
            results[name] = judged(left, signals(left, runs))
        tell("other recordings", results)
