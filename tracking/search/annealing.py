"""Annealing of a particle set (Deutscher, Blake, Reid 2000), with or without mean shift
(Naeem, Pridmore, Mills).

A likelihood w is first flattened to w^beta with a small beta, then sharpened layer by layer: layer
M is the broadest, layer 0 the last, and the noise shrinks with it. In the KAMS paper's figure the
last weights w_0 are not used; here the particles of layer 0 are weighed with them.
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
"""Share of the particles that survives a layer (alpha of Deutscher, Blake, Reid)."""
RATIO = 2.0
"""Ratio of the exponents of a layer and the layer before, in the fixed schedule."""
COOLING = 0.5
"""Ratio of the noise of a layer and of the layer before."""


class Schedule(StrEnum):
    """Rule for the exponents beta of the likelihood w^beta in the layers of annealing: "survival",
    with which half of the particles survive each layer, or "fixed", a geometric series, doubled
    from layer to layer, that ends at 1.
    """

    SURVIVAL = "survival"
    """The share `SURVIVAL` of the particles survives each layer (Deutscher, Blake, Reid)."""
    FIXED = "fixed"
    """A geometric series that ends at 1."""


@dataclass(frozen=True, slots=True)
class Annealing:
    """Settings of an annealed particle filter, which weighs its particles several times for a
    picture, with a sharper likelihood each time: number of these layers, and rule for the
    likelihood's exponents.
    """

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
    """Move and weigh particles layer by layer, and resample them between two layers; they keep the
    weights of the last layer.

    Args:
        cloud: The particles, which are changed.
        velocity: Expected change (4,) of x, y [px], theta [rad] and ln scale since the last frame.
        likelihood: Function that returns the log-likelihood (N,) of the particles; it may move them
            first.
        settings: Number of layers, and schedule of their exponents.
        widen: Factor on the noise of all layers.
    """
    for layer in range(settings.layers - 1, -1, -1):
        spread = widen * COOLING ** (settings.layers - 1 - layer)
        # The target has moved once: the later layers only refine.
        cloud.predict(velocity if layer == settings.layers - 1 else np.zeros(4), spread)
        w = likelihood(cloud)
        if settings.schedule == Schedule.SURVIVAL:
            # The share that survives is the effective sample size over N (Deutscher, Blake, Reid).
            beta = particle_loops.exponent(w, SURVIVAL * len(w))
        else:
            beta = RATIO**-layer
        cloud.weigh(beta * w)
        if layer > 0:  # the last weights give the estimate, which resampling would only blur
            cloud.resample()
