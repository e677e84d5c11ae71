"""Condensation: a particle filter on one colour histogram (Isard and Blake 1998; Perez et al.
2002).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from sim.types import Array
from tracking.appearance.bins import Labelled
from tracking.appearance.model import SampledModel
from tracking.search.particles import ParticleFilter
from tracking.settings import PLAIN, CloudSettings
from tracking.trackers._cloud import CloudTracker

FILTER: dict[str, Any] = PLAIN | {
    "noise": 1.0,
    "gamma": 20.0,
    "velocity_memory": 0.0,
    "scale_noise": 0.0,
    "scatter": 0.0,
}
"""The KAMS paper's particle filters with constant velocity. It does not give the noise: this is
half the largest motion per frame of its wildest sequences, for all filters alike. Its weights 1 - d
(`likelihood`) lose the target in every filter; these are the usual exp(-20 d^2).
"""
SAME = {"particles": 40}
"""The KAMS paper compares its filters with the same number of particles."""
PRESETS = {"paper": FILTER | SAME}


@dataclass(frozen=True, slots=True)
class Config(CloudSettings):
    """Particles and histogram."""

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
        """Predict and weigh: see `tracking.trackers._cloud.Search`."""
        cloud.predict(velocity, widen)
        cloud.weigh(self.log_likelihood(model.energy(image, cloud.samples)))
        return len(cloud.samples)
