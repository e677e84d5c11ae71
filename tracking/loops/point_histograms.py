"""Compiled loops on histograms of the pixels at fixed points of the template, which move with the
state: Bhattacharyya coefficients with reference histograms, and mean shift.

A state is (x, y, theta, ln scale). A point r of the template lies at (x, y) + scale R(theta) r in
the image; the pixel there has the label of its bin, or a negative label if it belongs to no bin.
Points on such pixels are left out of the histogram and of its normaliser, the sum of the weights;
points off the image are left out of the histogram alone.
"""

import numpy as np
from numpy.typing import NDArray

from sim.compiled import compiled
from sim.types import Array

Labels = NDArray[np.int16 | np.int32]
"""Bin numbers (h, w) of pixels; a negative one is in no bin."""
Window = tuple[Labels, int, int]
"""Labels (h, w) of the pixels in a part of the image, and its left and top [px]."""
Points = tuple[Array, NDArray[np.int64], Array]
"""Template points (P, 2) [px], their parts (P,) and their weights (P,)."""
Scratch = tuple[Array, NDArray[np.int64], NDArray[np.int64], Array]
"""Memory of a loop: a flat histogram of zeros (K * bins,), two arrays (P,) for indices of bins, and
the weight (K,) of each part's points that belong to no bin."""
LEAST_KEPT = 1e-9
"""A part whose points in bins weigh less than this counts as empty."""


@compiled()
def _read(window: Window, state: Array, template: Points, bins: int, scratch: Scratch) -> int:
    """Add the weights of the points at a state to the histogram in `scratch`.

    The index of each point's bin, or -1, is written to the second array of `scratch`, the indices
    of the bins that are not zero to the third, and the weight of each part's points on pixels in no
    bin to the fourth.

    Returns:
        The number of bins that are not zero.
    """
    labels, left, top = window
    points, parts, weights = template
    histogram, seen, used, masked = scratch
    masked[:] = 0.0
    h, w = labels.shape
    scale = np.exp(state[3])
    c = scale * np.cos(state[2])
    s = scale * np.sin(state[2])
    x0 = state[0] - left
    y0 = state[1] - top
    count = 0
    for p in range(len(points)):
        seen[p] = -1
        u = x0 + c * points[p, 0] - s * points[p, 1]
        v = y0 + s * points[p, 0] + c * points[p, 1]
        if 0.0 <= u < w and 0.0 <= v < h:
            label = labels[np.uint32(v), np.uint32(u)]
            if label >= 0:
                place = parts[p] * bins + label
                # The list of used bins saves a pass over all bins, of which most are empty.
                if histogram[place] == 0.0:
                    used[count] = place
                    count += 1
                histogram[place] += weights[p]
                seen[p] = place
            else:
                masked[parts[p]] += weights[p]
    return count


@compiled()
def _normalised(rho: float, masked: float) -> float:
    """Return a Bhattacharyya coefficient of a histogram whose weights sum to 1 - masked, as if they
    summed to 1; unchanged if masked is at least 1 - `LEAST_KEPT`.
    """
    if 0.0 < masked < 1.0 - LEAST_KEPT:
        return rho / np.sqrt(1.0 - masked)
    return rho


@compiled()
def _scratch(parts: int, bins: int, points: int) -> Scratch:
    indices = np.empty((2, points), np.int64)
    return np.zeros(parts * bins), indices[0], indices[1], np.zeros(parts)


@compiled()
def histograms(
    window: Window,
    state: Array,
    points: Array,
    parts: NDArray[np.int64],
    weights: Array,
    count: int,
    bins: int,
) -> Array:
    """Return the histograms (count, bins) of all parts of the template at one state, not
    normalised: sums of the weights of the points in each bin.

    Args:
        window: Bin numbers (h, w) of pixels, negative for none, and left and top of their part of
            the image [px].
        state: State (4,): x, y [px], theta [rad], ln scale.
        points: Template points (P, 2) from the target's centre, at scale 1 [px].
        parts: Part of each point (P,), 0..count-1.
        weights: Kernel weight of each point (P,).
        count: Number of parts.
        bins: Number of bins.
    """
    scratch = _scratch(count, bins, len(points))
    _read(window, state, (points, parts, weights), bins, scratch)
    return scratch[0].reshape((count, bins))


@compiled()
def coefficients(
    window: Window,
    states: Array,
    points: Array,
    parts: NDArray[np.int64],
    weights: Array,
    root_q: Array,
) -> Array:
    """Return the Bhattacharyya coefficients (N, K), 0..1, of the histograms of the K parts of the
    template at N states with their reference histograms.

    Args:
        window: Bin numbers (h, w) of pixels, negative for none, and left and top of their part of
            the image [px].
        states: States (N, 4): x, y [px], theta [rad], ln scale.
        points: Template points (P, 2) from the target's centre, at scale 1 [px].
        parts: Part of each point (P,), 0..K-1.
        weights: Kernel weight of each point (P,), above 0, summing to 1 over a part.
        root_q: Square roots of the reference histograms (K, B).
    """
    rho = np.zeros((len(states), len(root_q)))
    flat_q = root_q.ravel()
    bins = root_q.shape[1]
    scratch = _scratch(len(root_q), bins, len(points))
    histogram, _, used, masked = scratch
    for n in range(len(states)):
        count = _read(window, states[n], (points, parts, weights), bins, scratch)
        for i in range(count):
            place = used[i]
            rho[n, place // bins] += flat_q[place] * np.sqrt(histogram[place])
            histogram[place] = 0.0  # ready for the next state
        for k in range(len(root_q)):
            rho[n, k] = _normalised(rho[n, k], masked[k])
    return rho


@compiled()
def squared_distances(rho: Array) -> Array:
    """Return the squared distances (N,) of N states, 1 minus the mean of the K Bhattacharyya
    coefficients of each, but at least 0; `rho` (N, K) are the coefficients.
    """
    found = np.empty(len(rho))
    for n in range(len(rho)):
        total = 0.0
        for k in range(rho.shape[1]):
            total += rho[n, k]
        found[n] = max(1.0 - total / rho.shape[1], 0.0)
    return found


@compiled()
def _mean_shift_step(
    window: Window, state: Array, template: Points, pulls: Array, root_q: Array, scratch: Scratch
) -> tuple[float, float, float]:
    """Return the Bhattacharyya coefficient at a state (4,), and x and y of its mean-shift vector in
    the image [px]; three zeros if no point lies on a pixel in a bin of the reference.
    """
    count = _read(window, state, template, 0, scratch)
    points = template[0]
    (histogram, seen, used, masked) = scratch
    mass = 0.0
    shift_x = 0.0
    shift_y = 0.0
    rho = 0.0
    for i in range(count):  # the mass of a bin is replaced by the weight of its points
        root = float(np.sqrt(histogram[used[i]]))
        rho += float(root_q[used[i]] * root)
        histogram[used[i]] = root_q[used[i]] / root
    # Each point pulls by sqrt(q*_u / q_u) (Comaniciu, Ramesh, Meer 2003).
    for p in range(len(points)):
        if seen[p] >= 0:
            pull = histogram[seen[p]] * pulls[p]
            mass += pull
            shift_x += pull * points[p, 0]
            shift_y += pull * points[p, 1]
    for i in range(count):
        histogram[used[i]] = 0.0
    if mass == 0.0:  # no point lies on a colour of the target
        return 0.0, 0.0, 0.0
    scale = np.exp(state[3])
    c = scale * np.cos(state[2])
    s = scale * np.sin(state[2])
    shift_x = shift_x / mass
    shift_y = shift_y / mass
    rho = _normalised(rho, masked[0])
    return rho, c * shift_x - s * shift_y, s * shift_x + c * shift_y


@compiled()
def mean_shift(
    window: Window,
    states: Array,
    points: Array,
    weights: Array,
    pulls: Array,
    root_q: Array,
    most: int,
    tolerance: float,
) -> tuple[Array, Array, int]:
    """Return states (N, 4) moved in x and y to a local maximum of the Bhattacharyya coefficient
    with a reference histogram, by mean shift; angle and scale stay, and `states` is not changed.

    Args:
        window: Bin numbers (h, w) of pixels, negative for none, and left and top of their part of
            the image [px].
        states: First states (N, 4): x, y [px], theta [rad], ln scale.
        points: Template points (P, 2) from the target's centre, at scale 1 [px].
        weights: Kernel weights of the points (P,), summing to 1.
        pulls: Weights of the points in a step (P,): equal under an Epanechnikov kernel.
        root_q: Square roots of the reference histogram (1, B).
        most: Largest number of evaluated histograms for a state.
        tolerance: A shift not longer than this ends the search [px].

    Returns:
        States (N, 4), their coefficients (N,), and the number of evaluated histograms of all states
        together.
    """
    found = states.copy()
    rho = np.zeros(len(states))
    evaluations = 0
    template = points, np.zeros(len(points), np.int64), weights
    flat_q = root_q.ravel()
    scratch = _scratch(1, len(flat_q), len(points))
    for n in range(len(states)):
        here = found[n]
        rho[n], dx, dy = _mean_shift_step(window, here, template, pulls, flat_q, scratch)
        evaluations += 1
        left = most - 1
        while left > 0 and dx * dx + dy * dy > tolerance * tolerance:
            there = here.copy()
            there[0] += dx
            there[1] += dy
            better, next_x, next_y = _mean_shift_step(
                window, there, template, pulls, flat_q, scratch
            )
            evaluations += 1
            left -= 1
            # A step may pass the maximum: it is halved (Comaniciu, Ramesh, Meer 2003).
            if better < rho[n]:
                dx = dx / 2
                dy = dy / 2
                continue
            here[0] = there[0]
            here[1] = there[1]
            rho[n] = better
            dx = next_x
            dy = next_y
    return found, rho, evaluations
