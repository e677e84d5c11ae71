"""Weighted samples: normalisation, effective size, mean and covariance, systematic resampling."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim.types import Array


def normalised(log_weights: Array) -> Array:
    """Weights (N,) that sum to 1, of log-weights up to a constant."""
    weights = np.exp(log_weights - np.max(log_weights))
    return weights / weights.sum()


def effective_size(weights: Array) -> float:
    """How many equally weighted samples carry as much: 1 / sum w^2, between 1 and N."""
    return float(1.0 / np.sum(weights**2))


def mean(samples: Array, weights: Array) -> Array:
    """Weighted mean (D,) of samples (N, D). Angles must be continuous, as ours are."""
    return weights @ samples


def covariance(samples: Array, weights: Array) -> Array:
    """Weighted covariance (D, D) of samples (N, D)."""
    centred = samples - mean(samples, weights)
    return (centred * weights[:, None]).T @ centred


def systematic(weights: Array, rng: np.random.Generator) -> NDArray[np.intp]:
    """Indices (N,) of a systematic resampling (Kitagawa 1996): sample i is drawn floor or ceil of N
    w_i times.
    """
    count = len(weights)
    positions = (rng.random() + np.arange(count)) / count
    cumulative = np.cumsum(weights)
    cumulative[-1] = 1.0  # rounding must not leave the last position without a sample
    return np.searchsorted(cumulative, positions, side="right")
