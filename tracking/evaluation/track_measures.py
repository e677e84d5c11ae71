"""Measures of a track (a tracker's estimates for a sequence of pictures) against the target's true
outlines, each with its name, unit and better direction.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

import cv2
import numpy as np
from numpy.typing import NDArray

from sim.types import Array
from tracking.evaluation.track import Track
from tracking.sequences.quadrilateral import boxes

OVERLAPS = np.linspace(0, 1, 21)
"""Thresholds of the success curve, as in OTB (Wu, Lim, Yang 2013)."""
PIXELS = np.arange(51.0)
"""Thresholds of the precision curve [px]."""
SHARES = np.linspace(0, 0.5, 51)
"""Thresholds of the normalised precision curve, as shares of the target's size (Mueller et al.
2018)."""
NEAR = 20
"""Threshold of the reported precision [px]."""
LOSS_RUN = 5
"""Number of frames in a row with an error above the target's size that count as a loss."""
ON_TARGET = 0.1
"""Least overlap of a box that counts as on the target in `lost_signal`."""
RATE = 30.0
"""Rate of the pictures in `auc_streamed` [1/s]: sequences of benchmarks have no times."""
HALF = 0.5
"""Overlap above which the target is held in a frame."""
MOST = 0.9
"""Least share of such frames in a track that holds the target."""


class Better(Enum):
    """Direction in which the values of a measure are better: higher or lower."""

    HIGHER = "higher"
    LOWER = "lower"


@dataclass(frozen=True, slots=True)
class Comparison:
    """A track and the true corners (n, 4, 2) [px] of its target, nan where it is absent, compared
    in the m of n frames in which it is present.

    For these frames it has the offsets from the true to the estimated centre of the upright box (m,
    2), width and height of the true upright box (m, 2) [px], and the intersection over union of the
    upright boxes and of the outlines themselves (m,).
    """

    track: Track
    truth: Array
    """True corners (n, 4, 2) [px]; nan in frames without the target."""
    states: Array | None
    """True x, y [px], theta [rad], scale (n, 4) if they are known exactly, else None."""
    present: NDArray[np.bool_]
    """True in the frames with the target (n,)."""
    offsets: Array
    """From the true centres to the estimated ones (m, 2) [px]."""
    sizes: Array
    """Width and height (m, 2) of the true upright boxes [px]."""
    overlaps: Array
    """Intersection over union (m,) of the upright boxes."""
    turned_overlaps: Array
    """Intersection over union (m,) of the outlines themselves, convex quadrilaterals."""

    @staticmethod
    def of(track: Track, truth: Array, states: Array | None = None) -> "Comparison":
        """Compare a track with the target's true outlines in its pictures, up to the length of the
        shorter of both.

        Args:
            track: Estimates of a tracker.
            truth: True corners (n, 4, 2) [px]; nan in frames without the target.
            states: True x, y [px], theta [rad], scale (n, 4); None: not known exactly.
        """
        count = min(len(track.states), len(truth))
        truth, present = truth[:count], seen_in(truth[:count])
        seen = track.corners[:count][present]
        true = truth[present]
        a = boxes(seen)
        b = boxes(true)
        return Comparison(
            track,
            truth,
            None if states is None else states[:count],
            present,
            a[:, :2] + a[:, 2:] / 2 - b[:, :2] - b[:, 2:] / 2,
            b[:, 2:],
            box_overlaps(a, b),
            turned_overlaps(seen, true),
        )

    @property
    def errors(self) -> Array:
        """Distances (m,) between the true and the estimated centres of the upright boxes [px]."""
        return np.hypot(*self.offsets.T)

    def success(self) -> Array:
        """Return the shares (21,) of the frames with the target in which the intersection over
        union of the upright boxes exceeds 0, 0.05 ... 1.
        """
        return np.mean(self.overlaps > OVERLAPS[:, None], axis=1)

    def precision(self) -> Array:
        """Return the shares (51,) of the frames with the target whose centre error is at most 0, 1
        ... 50 px.
        """
        return np.mean(self.errors <= PIXELS[:, None], axis=1)


@dataclass(frozen=True, slots=True)
class TrackMeasure:
    """A measure of a track: its name, its unit, whether higher or lower is better, its meaning, the
    function that returns its value (nan where it does not apply), and its largest value.
    """

    name: str
    unit: str
    better: Better
    meaning: str
    of: Callable[[Comparison], float]
    """Returns the value in `unit`; nan where the measure does not apply."""
    most: float = np.inf
    """Largest possible value; the smallest is 0."""


def seen_in(corners: Array) -> NDArray[np.bool_]:
    """Return a mask (n,) that is True in frames with the target, by its true corners (n, 4, 2)
    [px]: those of an absent target are nan.
    """
    return np.asarray(np.isfinite(corners).all(axis=(1, 2)))


def box_overlaps(a: Array, b: Array) -> Array:
    """Return the intersection over union (n,) of pairs of upright boxes (n, 4): left, top, width,
    height [px].

    >>> box_overlaps(np.array([[0.0, 0.0, 2.0, 2.0]]), np.array([[1.0, 0.0, 2.0, 2.0]])).round(3)
    array([0.333])
    """
    low = np.maximum(a[:, :2], b[:, :2])
    high = np.minimum(a[:, :2] + a[:, 2:], b[:, :2] + b[:, 2:])
    shared = np.prod(np.maximum(high - low, 0), axis=1)
    union = np.prod(a[:, 2:], axis=1) + np.prod(b[:, 2:], axis=1) - shared
    return shared / np.maximum(union, 1e-12)


def turned_overlaps(a: Array, b: Array) -> Array:
    """Return the intersection over union (n,) of pairs of convex quadrilaterals (n, 4, 2) [px]."""
    overlaps = np.zeros(len(a))
    for i, (p, q) in enumerate(zip(a.astype(np.float32), b.astype(np.float32), strict=True)):
        shared = float(cv2.intersectConvexConvex(p, q)[0])
        overlaps[i] = shared / max(cv2.contourArea(p) + cv2.contourArea(q) - shared, 1e-12)
    return overlaps


def frames_until_loss(c: Comparison) -> float:
    """Return the number of frames with the target before it is lost. It is lost at the first of
    five successive ones in which the centre error exceeds the target's size (square root of its
    upright box's area). If it is never lost, return the number of all frames with the target.
    """
    away = c.errors > np.sqrt(np.prod(c.sizes, axis=1))
    runs = np.convolve(away, np.ones(LOSS_RUN), mode="valid") == LOSS_RUN
    return float(np.argmax(runs)) if runs.any() else float(len(away))


def lost_signal(c: Comparison) -> float:
    """Return the area under the ROC curve of 1 - confidence as a detector of frames in which the
    estimate is off the target (target absent, or overlap below 0.1); nan if all frames are off, or
    no frame is.
    """
    off = ~c.present
    off[c.present] = c.overlaps < ON_TARGET
    doubt = 1 - c.track.confidence[: len(off)]
    if off.all() or not off.any():
        return float("nan")
    from scipy import stats  # takes a second

    return float(stats.mannwhitneyu(doubt[off], doubt[~off]).statistic / (off.sum() * (~off).sum()))


def expected_overlap(c: Comparison) -> float:
    """Return the mean, over n = 1, 2 ..., of the mean overlap of the first n frames with the
    target: the intersection over union of upright boxes, 0..1. From a loss on (see
    `frames_until_loss`), the overlap counts as 0.

    The expected average overlap of the VOT challenge is this over some of the lengths of several
    sequences (Kristan and others, The visual object tracking VOT2015 challenge results, 2015).
    """
    overlaps = c.overlaps.copy()
    overlaps[round(frames_until_loss(c)) :] = 0.0
    return float(np.mean(np.cumsum(overlaps) / np.arange(1, len(overlaps) + 1)))


def late_success(c: Comparison, late: int) -> float:
    """Return the area under the success curve (AUC), 0 to 1, of a tracker whose estimates come
    `late` frames late: the outline in frame i is compared with the estimate for frame i - late, in
    the first `late` frames with that for the first frame (Li, Wang, Ramanan, Towards streaming
    perception, 2020).
    """
    return _success_of(c, np.maximum(np.arange(len(c.present)) - late, 0))


def streamed_success(c: Comparison) -> float:
    """Return the area under the success curve (AUC), 0 to 1, where frames come at 30 Hz, and each
    estimate arrives after the time that the tracker took for it; each frame is compared with the
    newest estimate that has arrived.

    A busy tracker misses the frames that come meanwhile. Its estimate for the next frame is assumed
    to be the one that it made when it saw all frames.
    """
    period = 1e3 / RATE
    count = len(c.present)
    arrivals = [0.0]  # the first frame's estimate is given
    frames = [0]
    frame = 1
    while frame < count:
        arrivals.append(max(arrivals[-1], frame * period) + c.track.milliseconds[frame])
        frames.append(frame)
        frame = max(frame + 1, int(arrivals[-1] // period))
    newest = np.searchsorted(arrivals, period * np.arange(count), side="right") - 1
    return _success_of(c, np.array(frames)[newest])


def _success_of(c: Comparison, estimates: NDArray[np.intp]) -> float:
    """Return the area under the success curve where frame i is compared with the estimate of frame
    `estimates[i]` (n,).
    """
    arrived = boxes(c.track.corners[estimates[c.present]])
    overlaps = box_overlaps(arrived, boxes(c.truth[c.present]))
    return float(np.mean(overlaps > OVERLAPS[:, None]))


def _state_rmse(c: Comparison, column: int) -> float:
    """Return the root mean square error of theta (column 2) [deg], or the relative one of the scale
    (column 3), over the frames that show the target; nan if the true states are unknown.
    """
    if c.states is None:
        return float("nan")
    present = c.present[: len(c.states)]
    true = c.states[present, column]
    difference = c.track.states[: len(c.states), column][present] - true
    if column == 2:
        return float(np.degrees(np.sqrt(np.mean(np.angle(np.exp(1j * difference)) ** 2))))
    return float(np.sqrt(np.mean((difference / true) ** 2)))


def _relative(c: Comparison) -> Array:
    """Return the distances (m,) of the centres, x over the target's width, y over its height."""
    return np.hypot(*(c.offsets / np.maximum(c.sizes, 1e-12)).T)


def _of_updates(c: Comparison, of: Callable[[Array], np.floating], values: Array) -> float:
    """Return the mean or median (`of`) of values (n,) over the frames for which the tracker made an
    estimate: without the first one, and without pictures that cannot be read; 0 if no frame is
    left.
    """
    made = c.track.milliseconds > 0
    made[:1] = False
    return float(of(values[made])) if made.any() else 0.0


MEASURES = (
    TrackMeasure(
        "auc",
        "",
        Better.HIGHER,
        "success: area under the curve of upright box overlap",
        lambda c: float(c.success().mean()),
        1.0,
    ),
    TrackMeasure(
        "auc_turned",
        "",
        Better.HIGHER,
        "auc of the overlap of the outlines themselves instead of their upright boxes",
        lambda c: float(np.mean(c.turned_overlaps > OVERLAPS[:, None])),
        1.0,
    ),
    TrackMeasure(
        "auc_late_1",
        "",
        Better.HIGHER,
        "success, each frame compared with the estimate of the frame before",
        lambda c: late_success(c, 1),
        1.0,
    ),
    TrackMeasure(
        "auc_late_3",
        "",
        Better.HIGHER,
        "success, each frame compared with the estimate of three frames before",
        lambda c: late_success(c, 3),
        1.0,
    ),
    TrackMeasure(
        "auc_streamed",
        "",
        Better.HIGHER,
        "success for pictures at 30 Hz, compared with the newest finished estimate",
        streamed_success,
        1.0,
    ),
    TrackMeasure(
        "expected_overlap",
        "",
        Better.HIGHER,
        "mean overlap of the first n frames, 0 from a loss on, averaged over all n",
        expected_overlap,
        1.0,
    ),
    TrackMeasure(
        "precision_20",
        "",
        Better.HIGHER,
        "share of frames with an error of at most 20 px",
        lambda c: float(c.precision()[NEAR]),
        1.0,
    ),
    TrackMeasure(
        "precision_norm",
        "",
        Better.HIGHER,
        "area under the curve of error over the target's size",
        lambda c: float(np.mean(_relative(c) <= SHARES[:, None])),
        1.0,
    ),
    TrackMeasure(
        "rmse_px",
        "px",
        Better.LOWER,
        "root mean square error of the centre",
        lambda c: float(np.sqrt(np.mean(c.errors**2))),
    ),
    TrackMeasure(
        "mean_error_px",
        "px",
        Better.LOWER,
        "mean error of the centre",
        lambda c: float(np.mean(c.errors)),
    ),
    TrackMeasure(
        "angle_rmse_deg",
        "deg",
        Better.LOWER,
        "root mean square error of theta",
        lambda c: _state_rmse(c, 2),
    ),
    TrackMeasure(
        "scale_rmse",
        "",
        Better.LOWER,
        "root mean square relative error of the size",
        lambda c: _state_rmse(c, 3),
    ),
    TrackMeasure(
        "frames_until_loss",
        "",
        Better.HIGHER,
        "frames before five in a row with an error above the target's size",
        frames_until_loss,
    ),
    TrackMeasure(
        "completed",
        "",
        Better.HIGHER,
        "1 if the target was never lost",
        lambda c: float(frames_until_loss(c) == len(c.errors)),
        1.0,
    ),
    TrackMeasure(
        "held",
        "",
        Better.HIGHER,
        "1 if the overlap exceeds 0.5 in 90 % of the frames",
        lambda c: float(np.mean(c.overlaps > HALF) >= MOST),
        1.0,
    ),
    TrackMeasure(
        "lost_auc",
        "",
        Better.HIGHER,
        "area under the ROC curve of 1 - confidence as a detector of estimates off the target",
        lost_signal,
        1.0,
    ),
    TrackMeasure(
        "milliseconds",
        "ms",
        Better.LOWER,
        "median time for a frame",
        lambda c: _of_updates(c, np.median, c.track.milliseconds),
    ),
    TrackMeasure(
        "evaluations",
        "",
        Better.LOWER,
        "mean number of histograms computed for a frame",
        lambda c: _of_updates(c, np.mean, c.track.evaluations),
    ),
)


def measure_all(comparison: Comparison) -> dict[str, float]:
    """Return the value of each of the `MEASURES` by its name, in its unit; nan for a measure that
    does not apply.
    """
    return {measure.name: measure.of(comparison) for measure in MEASURES}
