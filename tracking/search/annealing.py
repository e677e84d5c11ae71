"""Annealing of a particle set (Deutscher, Blake, Reid 2000), with or without mean shift
(Naeem, Pridmore, Mills).

A likelihood w is first flattened to w^beta with a small beta, then sharpened layer by layer: layer
M is the broadest, layer 0 the last, and the noise shrinks with it. The KAMS paper's figure stops
before w_0 is used; here the set that leaves layer 0 is weighed with it.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from sim.types import Array
from tracking.loops import particle_loops
from tracking.search.particles import ParticleFilter

# As published annealed filters have them: half of the particles survive a layer (Deutscher, Blake,
# Reid), and the noise halves with each.
SURVIVAL = 0.5
"""Share of the particles that survives a layer: alpha."""
RATIO = 2.0
"""Fixed schedule: each exponent over that of the layer before."""
COOLING = 0.5
"""Noise of a layer over the layer before."""


class Schedule(StrEnum):
    """Rule for the exponents of the layers."""

    SURVIVAL = "survival"
    """A given share of the particles survives each layer (Deutscher)."""
    FIXED = "fixed"
    """A geometric series that ends at 1."""


@dataclass(frozen=True, slots=True)
class Annealing:
    """Number of layers, and the schedule of their exponents."""

    layers: int
    schedule: Schedule


ONE_LAYER = Annealing(1, Schedule.FIXED)
"""No annealing: the particles are weighed once, with the likelihood as it is."""


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
        settings: Layers and schedule.
        widen: Factor on all noise.
    """
    for layer in range(settings.layers - 1, -1, -1):
        spread = widen * COOLING ** (settings.layers - 1 - layer)
        cloud.predict(velocity if layer == settings.layers - 1 else np.zeros(4), spread)
        w = likelihood(cloud)
        if settings.schedule == Schedule.SURVIVAL:
            beta = particle_loops.exponent(w, SURVIVAL * len(w))
        else:
            beta = RATIO**-layer
        cloud.weigh(beta * w)
        if layer > 0:
            cloud.resample()
