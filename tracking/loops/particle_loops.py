"""Compiled loops over the weighted samples of particle filters.

They assign numbers, not slices: numba compiles an assignment to a slice together with the text of
its error, which takes 1.7 s. Loops compile in a third of the time of sums of arrays.
"""

import numpy as np
from numpy.typing import NDArray

from sim.compiled import compiled
from sim.types import Array

BISECTIONS = 40
"""Number of bisections that find an exponent: to 1e-8 below `LARGEST_BETA`."""
LARGEST_BETA = 1e4
"""Largest exponent that is searched."""


@compiled()
def normalised(log_weights: Array) -> Array:
    """Return weights (N,) that sum to 1, from their natural logarithms (N,), to which any constant
    may be added.
    """
    # The largest becomes exp(0): without this, all could underflow to 0.
    top = -np.inf
    for log_weight in log_weights:
        top = max(top, log_weight)
    weights = np.empty_like(log_weights)
    total = 0.0
    for n in range(len(weights)):
        weights[n] = np.exp(log_weights[n] - top)
        total += weights[n]
    for n in range(len(weights)):
        weights[n] /= total
    return weights


@compiled()
def effective_size(weights: Array) -> float:
    """Return the effective sample size 1 / sum w^2, 1..N, of weights (N,) that sum to 1."""
    squares = 0.0
    for weight in weights:
        squares += weight * weight
    return 1.0 / squares


@compiled()
def mean(samples: Array, weights: Array) -> Array:
    """Return the mean (D,) of samples (N, D) with weights (N,) that sum to 1; angles must be
    continuous, not wrapped.
    """
    found = np.zeros(samples.shape[1])
    for n in range(len(samples)):
        for d in range(len(found)):
            found[d] += weights[n] * samples[n, d]
    return found


@compiled()
def covariance(samples: Array, weights: Array) -> Array:
    """Return the weighted covariance (D, D) of N samples (N, D) around their weighted mean, in the
    products of the samples' units; the weights (N,) sum to 1.
    """
    middle = mean(samples, weights)
    count = samples.shape[1]
    found = np.zeros((count, count))
    for n in range(len(samples)):
        for i in range(count):
            for j in range(count):
                apart = (samples[n, i] - middle[i]) * (samples[n, j] - middle[j])
                found[i, j] += weights[n] * apart
    return found


@compiled()
def systematic(weights: Array, first: float) -> NDArray[np.int64]:
    """Return the indices (N,) of the samples that a systematic resampling draws (Kitagawa 1996).

    Sample i is drawn floor or ceil of N w_i times, where w_i is its weight over the sum of all
    weights.

    Args:
        weights: Weights (N,), not negative, with any sum.
        first: A uniform random number of [0, 1): the place of the first sample in its step.
    """
    count = len(weights)
    total = 0.0
    for weight in weights:
        total += weight
    step = total / count
    drawn = np.empty(count, np.int64)
    i = 0
    reached = weights[0]
    for n in range(count):
        # The last position could exceed the sum by rounding: i stays below N.
        while reached <= (n + first) * step and i < count - 1:
            i += 1
            reached += weights[i]
        drawn[n] = i
    return drawn


@compiled()
def exponent(log_likelihood: Array, target: float) -> float:
    """Return the beta, from 0 to 10,000, for which the weights w^beta have a given effective sample
    size, by bisection; one of the ends if no beta has it.

    Args:
        log_likelihood: Natural logarithm ln w of each weight (N,).
        target: Effective sample size, 1..N: (sum v)^2 / sum v^2 of v = w^beta.
    """
    low = 0.0
    high = LARGEST_BETA
    top = np.max(log_likelihood)
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        total = squares = 0.0
        for w in log_likelihood:
            weight = np.exp(middle * (w - top))
            total += weight
            squares += weight * weight
        # A larger exponent leaves weight to fewer samples: the effective size falls with beta.
        if total * total / squares > target:
            low = middle
        else:
            high = middle
    return low
