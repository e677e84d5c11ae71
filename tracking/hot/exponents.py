"""Compiled loop for the exponent that flattens a likelihood to an effective sample size."""

from __future__ import annotations

import numpy as np

from sim.types import Array
from tracking.hot.compiled import compiled


@compiled()
def exponent(log_likelihood: Array, target: float, highest: float, steps: int) -> float:
    """The beta below `highest` for which w^beta has a given effective sample size, by bisection.

    Args:
        log_likelihood: ln w (N,).
        target: Effective sample size 1 / sum w^2 of the normalised weights.
        highest: Largest beta.
        steps: Number of bisections.
    """
    low, high, top = 0.0, highest, np.max(log_likelihood)
    for _ in range(steps):
        middle = (low + high) / 2
        total = squares = 0.0
        for w in log_likelihood:
            weight = np.exp(middle * (w - top))
            total += weight
            squares += weight * weight
        if total * total / squares > target:
            low = middle
        else:
            high = middle
    return low
