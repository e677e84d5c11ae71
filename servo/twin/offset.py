"""The clock's offset between a film and a robot's log, from the mean motion of the picture alone:
no mount has to be known.

The affine flow of each pair of pictures is a linear function of the hand's twist, whatever the
mount, as long as the scene is about as far everywhere. The offset is the one at which this function
explains most: the log determinant of the residuals' covariance is least.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import t as student

from servo.twin.robot_motion import RobotMotion
from servo.twin.tracks import Tracks
from sim.types import Array

WIDEST = 1.0
"""Largest offset that is sought [s]."""
STEP = 5e-3
"""Interval of the curve [s]."""
OFFSETS: Array = STEP * np.arange(-200.0, 201.0)
"""Offsets of the curve [s]."""
BLOCK = 2.0
"""Length of the blocks of the bootstrap [s]."""
DRAWS = 200
"""Number of samples of the bootstrap."""
ROUNDS = 5
"""Steps of the robust fit of an affine flow."""
SCALE = 0.5
"""Least distance from an affine flow at which a point counts half in its fit [px]; it is the median
distance of the points if that is larger."""
LEVEL = 0.95
"""Confidence level of the intervals."""
TINY = 1e-12
"""Added to variances, so that pictures without any motion have a logarithm."""


@dataclass(frozen=True, slots=True)
class Offset:
    """The offset between the clocks of a film and of a robot's log: a picture with the stamp t was
    taken at t + `value` [s] on the log's clock. The curve over all offsets shows how well each
    explains the film.
    """

    value: float
    """The offset [s]."""
    half: float
    """Half of its 95 % interval [s]."""
    depth: float
    """Median less minimum of the curve; small where the motion does not show the offset."""
    offsets: Array
    """Offsets of the curve (n,) [s]."""
    curve: Array
    """Log determinant of the residuals' covariance at each (n,)."""
    at_end: bool
    """True if the minimum is at an end of the searched offsets."""


def affine_flows(steps: Tracks) -> Array:
    """Return the affine flow (p, 6) of each pair of pictures [1/s]: u0, u_x, u_y, v0, v_x, v_y. The
    velocity of a point (x, y), in normalised image coordinates, is then (u0 + u_x x + u_y y, v0 +
    v_x x + v_y y).
    """
    intervals = (steps.times[steps.second] - steps.times[steps.first])[:, None, None]
    middle = (steps.before + steps.after) / 2
    flow = (steps.after - steps.before) / intervals
    basis = np.concatenate([np.ones((*middle.shape[:2], 1)), middle], axis=2)
    weights = steps.known.astype(float)
    counted = steps.known | ~steps.known.any(axis=1, keepdims=True)  # no median of nothing
    ridge = 1e-9 * np.eye(3)
    fit = np.zeros((len(flow), 3, 2))
    for _ in range(ROUNDS):
        weighted = basis * weights[..., None]
        normal = weighted.transpose(0, 2, 1) @ basis + ridge
        fit = np.linalg.solve(normal, weighted.transpose(0, 2, 1) @ flow)
        away = np.linalg.norm(flow - basis @ fit, axis=2) * intervals[..., 0] * steps.focal
        typical = np.nanmedian(np.where(counted, away, np.nan), axis=1, keepdims=True)
        scale = np.maximum(SCALE, typical)
        weights = steps.known / (1 + (away / scale) ** 2)
    return np.asarray(fit.transpose(0, 2, 1).reshape(len(fit), 6), np.float64)


def regressors(motion: RobotMotion, steps: Tracks, offset: float) -> Array:
    """Return, for each of the p pairs of pictures, 1 and the hand's mean twist between them [m/s,
    rad/s], in the hand's frame (p, 7).

    Args:
        motion: The hand's motion.
        steps: Points that were followed, with the times of the pictures.
        offset: Offset of the film's clock, to be added to the pictures' times [s].
    """
    begin = steps.times[steps.first] + offset
    twists = motion.twists(begin, steps.times[steps.second] + offset)
    return np.hstack([np.ones((len(twists), 1)), twists])


def found(motion: RobotMotion, steps: Tracks, flows: Array, rng: np.random.Generator) -> Offset:
    """Return the offset between the clocks of a film and of a robot's log, from -1 to 1 s, with a
    95 % interval by a bootstrap over blocks of 2 s.

    Args:
        motion: The hand's motion.
        steps: Points that were followed between consecutive pictures.
        flows: Affine flows (p, 6) of these pairs of pictures [1/s].
        rng: Generator of the bootstrap's samples.
    """
    blocks = (steps.times[steps.first] // BLOCK).astype(int)
    blocks -= blocks.min()
    number = int(blocks.max()) + 1
    products = np.stack([_products(motion, steps, flows, x, blocks, number) for x in OFFSETS])
    least = _offset(_curve(products.sum(axis=1)))
    draws: list[float] = []
    for _ in range(DRAWS):
        counts = np.bincount(rng.integers(number, size=number), minlength=number)
        draws.append(_least(OFFSETS, _curve(np.einsum("b,nbij->nij", counts, products))))
    low, high = np.quantile(draws, [0.16, 0.84])
    # A bootstrap of few blocks varies less than they do.
    freedom = max(number - 1, 1)
    factor = float(student.ppf((1 + LEVEL) / 2, freedom)) * np.sqrt(number / freedom)
    return replace(least, half=factor * max(float(np.std(draws)), (high - low) / 2))


def curve_of(motion: RobotMotion, steps: Tracks, flows: Array) -> Offset:
    """Return the offset of a film's clock, from -1 to 1 s, without an interval (`half` is 0).

    Args:
        motion: The hand's motion.
        steps: Points that were followed between consecutive pictures.
        flows: Affine flows (p, 6) of these pairs of pictures [1/s].
    """
    one = np.zeros(len(flows), int)
    return _offset(
        _curve(np.stack([_products(motion, steps, flows, x, one, 1)[0] for x in OFFSETS]))
    )


def _offset(curve: Array) -> Offset:
    """Return the offset at the minimum of a curve (n,)."""
    return Offset(
        _least(OFFSETS, curve),
        0.0,
        float(np.median(curve) - curve.min()),
        OFFSETS,
        curve,
        int(np.argmin(curve)) in (0, len(curve) - 1),
    )


def explained(
    motion: RobotMotion, steps: Tracks, flows: Array, offsets: Array
) -> tuple[float, float]:
    """Return the offset of a film's clock [s] at which the hand's motion explains the flows best,
    and the least log determinant of the residuals' covariance over the given offsets.

    Args:
        motion: The hand's motion.
        steps: Points that were followed between consecutive pictures.
        flows: Affine flows (p, 6) of these pairs of pictures [1/s].
        offsets: Even grid of offsets to try (n,) [s]; the result may lie between two of them.
    """
    one = np.zeros(len(flows), int)
    products = np.stack([_products(motion, steps, flows, each, one, 1)[0] for each in offsets])
    curve = _curve(products)
    return _least(offsets, curve), float(curve.min())


def _products(
    motion: RobotMotion, steps: Tracks, flows: Array, offset: float, blocks: Array, number: int
) -> Array:
    """Return the sums (number, 13, 13) over blocks of the products of regressors and flows; rows of
    pictures outside of the log are left out.
    """
    begin = steps.times[steps.first] + offset
    inside = (begin >= motion.times[0]) & (begin <= motion.times[-1])
    rows = np.hstack([regressors(motion, steps, offset), flows]) * inside[:, None]
    return np.stack([rows[blocks == k].T @ rows[blocks == k] for k in range(number)])


def _curve(products: Array) -> Array:
    """Return the log determinant (n,) of the covariance of the flows' residuals, from the sums of
    products (n, 13, 13).
    """
    inner = products[:, :7, :7]
    cross = products[:, :7, 7:]
    outer = products[:, 7:, 7:]
    count = np.maximum(inner[:, :1, :1], 1.0)
    ridge = 1e-9 * count * np.eye(7)
    left = outer - cross.transpose(0, 2, 1) @ np.linalg.solve(inner + ridge, cross)
    return np.linalg.slogdet(left / count + TINY * np.eye(6))[1]


def _least(offsets: Array, curve: Array) -> float:
    """Return the offset of the minimum of a curve (n,), by a parabola through three values."""
    k = int(np.clip(np.argmin(curve), 1, len(curve) - 2))
    before, here, after = curve[k - 1 : k + 2]
    bend = before - 2 * here + after
    shift = 0.5 * (before - after) / bend if bend > 0 else 0.0
    return float(offsets[k] + np.clip(shift, -1, 1) * (offsets[1] - offsets[0]))
