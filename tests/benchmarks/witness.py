"""Whether a tracker with a witness knows better when it is wrong, on recordings with the truth:

    uv run python tests/benchmarks/witness.py FOLDER ... [seeds=N] [trackers=NAME,NAME:PRESET] [chart=FILE.png]

The rule, written before the run:

- Every tracker sees each recording, and two versions of it under stress. *turned*: each picture is turned by 3 deg more
  about the target's centre, in recordings of a target whose sides differ by less than `SQUARE`: a box without an angle
  cannot be right of another. *deformed*: the pixels in and around the target move by up to 15 % of its size in waves. The
  truth stays the upright box.
- *Off* is an overlap of the upright boxes below .1, or no target; *right* is one above .5. The first picture does not count.
- The unit is the recording (targets in the same pictures are one); figures are means over recordings, after the mean over
  seeds. ROC is the area of the confidence as a sign of pictures that are not off, in recordings that have both kinds.
- The weights of the verdict are fitted anew for each recording, without it, on all three versions of the others: a
  logistic regression of right against off; each recording counts alike, right and off alike. LOCKED, LOST, ROC and the
  reliability of `left out` come from these weights, on the signs of the tracker's run with the weights as they are.
- The witness wins if, on the plain recordings, its AUC is above that of the tracker without it by at least .04, not below
  it on the turned ones, LOCKED though off at most 5 %, LOST though right at most 4 %, and ROC at least .84.
"""

import sys
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from scipy.optimize import minimize
from scipy.stats import mannwhitneyu

import tracking
from sim.types import Frame
from tracking import verdict
from tracking.drawing.figures import panels, save
from tracking.evaluation.track_measures import HALF, ON_TARGET, OVERLAPS, box_overlaps, seen_in
from tracking.sequences.quadrilateral import boxes
from tracking.sequences.sequence import read_all
from tracking.trackers import _cloud
from tracking.types import Status

TRACKERS = "annealed,annealed:video"
RATE = 30.0
TURN = 3.0
"""Turn of a picture against the one before [deg]."""
SQUARE = 1.6
"""Largest ratio of the sides of a target that is turned."""
BENT = 0.15
"""Largest shift of a pixel of a deformed target, over the target's size."""
WAVE = 25
"""Pictures in which a wave passes through the target."""
RIDGE = 1e-3
"""Weight of the squared weights in a fit, which keeps them finite."""
BINS = np.linspace(0, 1, 11)
VERSIONS = ("plain", "turned", "deformed")
LEFT_OUT = "left out"


@dataclass(frozen=True, slots=True)
class Run:
    """What a tracker said of a recording, and what is true."""

    recording: str
    version: str
    tracker: str
    statuses: np.ndarray
    confidence: np.ndarray
    overlaps: np.ndarray
    """Intersection over union (n,); 0 without the target."""
    seen: np.ndarray
    """True in the pictures with the target (n,)."""
    signs: np.ndarray
    """Answer, distance, and the part of the logit by comparison with the usual (n, 3); empty without
    a witness."""

    @property
    def off(self):
        return self.overlaps < ON_TARGET

    @property
    def right(self):
        return self.overlaps > HALF


class Noted(verdict.Verdict):
    """A verdict that notes the signs of each frame."""

    def __init__(self):
        super().__init__()
        self.signs = []

    def judge(self, signs, time, *, anew=False):
        usual = self._usual or signs
        share = np.clip(signs.answer / max(usual.answer, verdict.LEAST), 0, 1)
        fall = np.clip(usual.first - signs.first, 0, 1)
        given = verdict.BY_SHARE * share + verdict.BY_FALL * fall
        self.signs.append((signs.answer, max(signs.distance, verdict.ALIKE), given))
        return super().judge(signs, time, anew=anew)


class Reweighed(verdict.Verdict):
    """A verdict whose logits are given."""

    def logit(self, signs):
        return signs.answer


def stressed(image, version, number, middle, size):
    """Return a picture (H, W, 3) with the target, of a centre and size (2,) [px], turned or
    deformed.
    """
    height, width = image.shape[:2]
    x, y = np.meshgrid(
        np.arange(width, dtype=np.float32) + 0.5 - np.float32(middle[0]),
        np.arange(height, dtype=np.float32) + 0.5 - np.float32(middle[1]),
    )
    if version == "turned":
        c, s = np.cos(np.radians(TURN * number)), np.sin(np.radians(TURN * number))
        u, v = c * x + s * y, c * y - s * x
    else:
        near = BENT * np.exp(-2 * ((x / size[0]) ** 2 + (y / size[1]) ** 2))
        near *= min(1.0, number / 10)  # the first picture is as it is
        phase = 2 * np.pi * number / WAVE
        u = x + size[0] * near * np.sin(2 * np.pi * y / size[1] + phase)
        v = y + size[1] * near * np.sin(2 * np.pi * x / size[0] + 1.3 * phase)
    u, v = (u + middle[0] - 0.5).astype(np.float32), (v + middle[1] - 0.5).astype(np.float32)
    return cv2.remap(image, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT)


def followed(sequence, names, seeds):
    """Return the runs of all trackers and versions; all get a picture together, so that it is read
    once.
    """
    region = sequence.region
    ratio = max(region.width / region.height, region.height / region.width)
    versions = [v for v in VERSIONS if v != "turned" or ratio < SQUARE]
    made = {}
    for version in versions:
        for name in names:
            for seed in range(seeds):
                kind, _, preset = name.partition(":")
                tracker = tracking.create(kind, seed=seed, preset=preset or None)
                made[version, name, seed] = tracker, [], []
    middle, size = None, None
    for index, picture in enumerate(sequence.source):
        box = sequence.truth[index] if index < len(sequence.truth) else np.full((4, 2), np.nan)
        if np.isfinite(box).all():  # else the last one holds
            middle, size = (box.min(axis=0) + box.max(axis=0)) / 2, np.ptp(box, axis=0)
        shown = {"plain": picture.image}
        for version in versions[1:]:
            shown[version] = stressed(picture.image, version, index, middle, size)
        for (version, *_), (tracker, statuses, corners) in made.items():
            frame = Frame(shown[version], picture.time, index)
            if index == 0:
                tracker.start(frame, region, sequence.start)
                continue
            found = tracker.update(frame)
            statuses.append((found.status, 1 - found.distance))
            corners.append(found.outline(region))
    truth = sequence.truth[1:]
    seen = seen_in(truth)
    runs = []
    for (version, name, _), (tracker, statuses, corners) in made.items():
        overlaps = np.zeros(len(truth))
        places = np.stack(corners)[: len(truth)]
        overlaps[seen] = box_overlaps(boxes(places[seen]), boxes(truth[seen]))
        states, confidence = zip(*statuses[: len(truth)], strict=True)
        noted = getattr(tracker, "_verdict", None)
        signs = np.array(noted.signs if isinstance(noted, Noted) and noted.signs else [])
        recording = sequence.name.split("-")[0]
        of = np.array(states), np.array(confidence), overlaps, seen, signs
        runs.append(Run(recording, version, name, *of))
    return runs


def fitted(runs):
    """Return bias and weights (3,) of a logistic regression of right against off pictures; those of
    the comparison with the usual stay.
    """
    rows, labels, weights = [], [], []
    for run in runs:
        for label, kept in ((1.0, run.right), (0.0, run.off)):
            rows.append(run.signs[kept])
            labels.append(np.full(kept.sum(), label))
            weights.append(np.full(kept.sum(), 1 / len(kept)))
    x, y, w = np.vstack(rows), np.concatenate(labels), np.concatenate(weights)
    w = np.where(y > 0, w / w[y > 0].sum(), w / w[y == 0].sum())
    z = np.column_stack([np.ones(len(x)), x[:, :2]])
    given = x[:, 2]

    def loss(b):
        return w @ np.logaddexp(0, (1 - 2 * y) * (z @ b + given)) + RIDGE * b[1:] @ b[1:]

    return minimize(loss, np.zeros(3), method="BFGS").x


def again(run, weights):
    """Return a run with the statuses and the confidence that other weights of the verdict give."""
    judge = Reweighed()
    logits = weights[0] + run.signs @ [*weights[1:], 1.0]
    confidence, statuses = [], []
    for number, logit in enumerate(logits.clip(-verdict.MOST, verdict.MOST).tolist()):
        confidence.append(judge.judge(verdict.Signs(logit, 0.0, 0.0), number / RATE))
        statuses.append(judge.status)
    of = np.array(statuses), np.array(confidence), run.overlaps, run.seen, run.signs
    return Run(run.recording, run.version, LEFT_OUT, *of)


def left_out(runs):
    """Return the runs with a witness, each judged by weights of the other recordings."""
    found = []
    for name in sorted({run.recording for run in runs}):
        weights = fitted([run for run in runs if run.recording != name])
        sys.stderr.write(f"without {name}: {np.round(weights, 2).tolist()}\n")
        found += [again(run, weights) for run in runs if run.recording == name]
    sys.stderr.write(f"with all: {np.round(fitted(runs), 2).tolist()}\n")
    return found


def figures(run):
    """Return AUC, LOCKED though off, LOST though right, right that are LOCKED, ROC area (5,)."""
    locked, lost = run.statuses == Status.LOCKED, run.statuses == Status.LOST
    on, off = run.confidence[~run.off], run.confidence[run.off]
    with np.errstate(invalid="ignore"):
        shares = (
            100 * (locked & run.off).sum() / locked.sum(),
            100 * (lost & run.right).sum() / run.right.sum(),
            100 * (locked & run.right).sum() / run.right.sum(),
        )
    both = len(on) > 0 and len(off) > 0
    area = mannwhitneyu(on, off).statistic / (len(on) * len(off)) if both else np.nan
    return np.array([np.mean(run.overlaps[run.seen] > OVERLAPS[:, None]), *shares, area])


def by_recording(runs):
    """Return the means of the figures over the runs of each recording (recordings, 5)."""
    names = sorted({run.recording for run in runs})
    found = [np.array([figures(run) for run in runs if run.recording == name]) for name in names]
    with np.errstate(all="ignore"):
        counts = [np.isfinite(rows).sum(axis=0) for rows in found]
        return np.array([np.nansum(r, axis=0) / c for r, c in zip(found, counts, strict=True)])


def reliability(runs):
    """Return the mean confidence, the share of right pictures, and the share of all, by bins of
    confidence (10, 3); each recording counts alike.
    """
    confidence = np.concatenate([run.confidence for run in runs])
    right = np.concatenate([run.right for run in runs])
    weights = np.concatenate([np.full(len(run.right), 1 / len(run.right)) for run in runs])
    at = np.clip(np.digitize(confidence, BINS) - 1, 0, len(BINS) - 2)
    total, means, shares = (
        np.bincount(at, of, len(BINS) - 1)
        for of in (weights, weights * confidence, weights * right)
    )
    with np.errstate(invalid="ignore"):
        return np.column_stack([means / total, shares / total, total / total.sum()])


def chart(curves, file):
    """Write the reliability diagram of named runs."""
    figure, (ax,) = panels(4.6, 4.2)
    ax.plot((0, 1), (0, 1), color="0.6", lw=1)
    for (name, runs), style in zip(curves.items(), ("o-", "s--", "^:"), strict=False):
        found = reliability(runs)
        kept = found[:, 2] > 0.005  # a few pictures say nothing
        ax.plot(found[kept, 0], found[kept, 1], style, ms=4, lw=1.5, label=name)
    ax.set(xlabel="confidence", ylabel="share of right pictures", xlim=(0, 1), ylim=(0, 1))
    ax.legend(frameon=False, fontsize=8)
    save(figure, file.parent, file.name)


def main(*words):
    options = dict(word.split("=", 1) for word in words if "=" in word)
    folders = [word for word in words if "=" not in word]
    names = options.get("trackers", TRACKERS).split(",")
    _cloud.Verdict = Noted
    runs = []
    for sequence in [s for folder in folders for s in read_all(Path(folder), RATE)]:
        runs += followed(sequence, names, int(options.get("seeds", "1")))
        sys.stderr.write(f"{sequence.name}\n")
    with_witness = [run for run in runs if len(run.signs)]
    others = left_out(with_witness)
    rows = ["| | AUC | LOCKED though off | LOST though right | right that are LOCKED | ROC |"]
    rows.append("|---|---|---|---|---|---|")
    for version in VERSIONS:
        for name in (*names, LEFT_OUT):
            found = by_recording(
                [r for r in runs + others if (r.version, r.tracker) == (version, name)]
            )
            auc, *shares, area = np.nanmean(found, axis=0)
            cells = " | ".join(f"{share:.1f} %" for share in shares)
            worst = f"{np.nanmax(found[:, 1]):.0f}"
            rows.append(
                f"| {version} `{name}` | {auc:.3f} | {cells} | {area:.3f} | worst {worst} %"
            )
    sys.stdout.write("\n".join(rows) + "\n")
    for name in sorted({run.recording for run in runs}):
        cells = []
        for tracker in (*names, LEFT_OUT):
            of = [
                r
                for r in runs + others
                if (r.recording, r.version, r.tracker) == (name, "plain", tracker)
            ]
            cells.append(" ".join(f"{f:7.2f}" for f in by_recording(of)[0]))
        sys.stdout.write(f"{name:22}{' | '.join(cells)}\n")
    sys.stdout.write(f"{np.round(reliability(others), 2).tolist()}\n")
    if "chart" in options:
        curves = {f"{v}, {LEFT_OUT}": [r for r in others if r.version == v] for v in VERSIONS}
        chart(curves, Path(options["chart"]))


if __name__ == "__main__":
    main(*sys.argv[1:])
