"""Annealing of a particle set (Deutscher, Blake, Reid 2000), with or without mean shift
(Naeem, Pridmore, Mills).

A likelihood w is first flattened to w^beta with a small beta, then sharpened layer by layer: layer
M is the broadest, layer 0 the last, and the noise shrinks with it. The KAMS paper's figure stops
before w_0 is used; here the set that leaves layer 0 is weighed with it.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

import numpy as np

from sim.types import Array
from tracking.hot import particle_loops
from tracking.search.particles import ParticleFilter

BISECTIONS = 40
LARGEST_BETA = 1e4


class Schedule(Enum):
    """Where the exponents of the layers come from."""

    SURVIVAL = "survival"
    """So that a given share of the particles survives each layer (Deutscher)."""
    FIXED = "fixed"
    """A geometric series that ends at 1."""


@dataclass(frozen=True, slots=True)
class Annealing:
    """How many layers, how sharp, how far apart."""

    layers: int
    schedule: Schedule
    survival: float
    """Share of the particles that survives a layer: alpha."""
    ratio: float
    """Fixed schedule: each exponent over the next, sharper one."""
    cooling: float
    """Noise of a layer over the layer before."""


def exponent(log_likelihood: Array, survival: float) -> float:
    """The beta with which w^beta has an effective sample size of survival * N, by bisection."""
    target = survival * len(log_likelihood)
    return particle_loops.exponent(log_likelihood, target, LARGEST_BETA, BISECTIONS)


def anneal(
    cloud: ParticleFilter,
    velocity: Array,
    likelihood: Callable[[ParticleFilter], Array],
    settings: Annealing,
    widen: float,
) -> None:
    """Move a cloud through all layers; it ends weighed with the sharpest likelihood, not resampled.

    Args:
        cloud: The particles.
        velocity: Their motion since the last frame (4,), before the first layer.
        likelihood: Log-likelihood (N,) of the particles where they are; it may move them first.
        settings: The schedule.
        widen: Factor on all noise.
    """
    for layer in range(settings.layers - 1, -1, -1):
        spread = widen * settings.cooling ** (settings.layers - 1 - layer)
        cloud.predict(velocity if layer == settings.layers - 1 else np.zeros(4), spread)
        w = likelihood(cloud)
        if settings.schedule is Schedule.SURVIVAL:
            beta = exponent(w, settings.survival)
        else:
            beta = settings.ratio**-layer
        cloud.weigh(beta * w)
        if layer > 0:
            cloud.resample()
