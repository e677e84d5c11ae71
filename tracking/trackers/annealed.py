"""Annealed particle filter on one colour histogram (Deutscher, Blake, Reid 2000)."""

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from annotated_types import Ge, Le

from sim.ranges import Share
from sim.types import Array
from tracking.appearance.bins import Labelled
from tracking.appearance.model import SampledModel
from tracking.recognition import LOCK
from tracking.search.annealing import Annealing, Schedule, anneal
from tracking.search.particles import ParticleFilter
from tracking.settings import CloudSettings
from tracking.trackers import condensation
from tracking.trackers._cloud import CloudTracker

CLIMB_TOLERANCE = 0.5
"""A particle whose shift is shorter has arrived [px]."""
LAYERS: dict[str, Any] = condensation.FILTER | {
    "velocity_memory": 1.0,
    "schedule": "fixed",
    "layers": 5,
}
"""The annealing of the KAMS paper: no motion model; M = 4, so five layers."""
VIDEO: dict[str, Any] = {"views": 6, "scatter": 0.5, "widen_when_lost": 1.0, "lock": LOCK}
"""For recordings: recognised by views too."""
PRESETS = {"paper": LAYERS | condensation.SAME, "video": VIDEO}


@dataclass(frozen=True, slots=True)
class Config(CloudSettings):
    """Particles, histogram, and layers."""

    particles: Annotated[int, Ge(1), Le(100_000)] = 100
    noise: Annotated[float, Ge(0), Le(10)] = 0.3
    """Spread of position in the first layer, over the target's size."""
    velocity_memory: Share = 1.0
    scale_noise: Share = 0.015
    layers: Annotated[int, Ge(1), Le(50)] = 5
    """Number of annealing layers."""
    schedule: Schedule = Schedule.SURVIVAL
    """"survival": exponents by the survival rate; "fixed": a geometric series."""
    survival: Annotated[float, Ge(0.001), Le(0.999)] = 0.5
    """Share of the particles that survives a layer."""
    ratio: Annotated[float, Ge(1), Le(100)] = 2.0
    """Fixed schedule: each exponent over the one of the layer before."""
    cooling: Annotated[float, Ge(0.001), Le(1)] = 0.5
    """Noise of a layer over the layer before."""
    climb: Annotated[int, Ge(0), Le(100)] = 0
    """Mean-shift histograms for each particle in each layer; 0: none (that is `kams`)."""

    def build(self, rng: np.random.Generator) -> CloudTracker:
        """The tracker; its samples are drawn from the generator."""
        return CloudTracker(self, self.search, rng)

    def search(
        self,
        cloud: ParticleFilter,
        model: SampledModel,
        image: Labelled,
        velocity: Array,
        widen: float,
    ) -> int:
        """Layers of diffusion, climb, measurement and selection, each sharper than the one before:
        see `tracking.trackers._cloud.Search`.
        """
        evaluations = 0

        def likelihood(cloud: ParticleFilter) -> Array:
            nonlocal evaluations
            if self.climb > 0:
                cloud.samples, _, climbed = model.climb(
                    image,
                    cloud.samples,
                    most=self.climb,
                    tolerance=CLIMB_TOLERANCE,
                    reach=cloud.size,
                )
                evaluations += climbed
            evaluations += len(cloud.samples)
            return self.log_likelihood(model.energy(image, cloud.samples))

        schedule = Schedule(self.schedule)
        layers = Annealing(self.layers, schedule, self.survival, self.ratio, self.cooling)
        anneal(cloud, velocity, likelihood, layers, widen)
        return evaluations
