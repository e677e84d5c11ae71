"""Condensation: a particle filter on one colour histogram (Isard and Blake 1998; Perez et al.
2002).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from sim.types import Image
from tracking.appearance.layout import Sampling
from tracking.appearance.model import SampledModel
from tracking.settings import PLAIN, AppearanceSettings, DiscPoints, ParticleSettings
from tracking.trackers._cloud import CloudMethod, CloudTracker
from tracking.types import Region, State

FILTER: dict[str, Any] = PLAIN | {
    "noise": 1.0,
    "gamma": 20.0,
    "velocity_memory": 0.0,
    "scale_noise": 0.0,
    "scatter": 0.0,
}
"""The KAMS paper's particle filters with constant velocity. It does not give the noise: this is
half the largest motion per frame of its wildest sequences, for all filters alike. Its weights 1 - d
lose the target in every filter; these are the usual exp(-20 d^2).
"""
SAME = {"particles": 40}
"""The KAMS paper compares its filters with the same number of particles."""
PRESETS = {"paper": FILTER | SAME}


@dataclass(frozen=True, slots=True)
class Config(AppearanceSettings, ParticleSettings):
    """Particles and histogram."""

    density: DiscPoints = 16
    """Points along the kernel's diameter at which the image is read."""

    def model(self, image: Image, region: Region, state: State) -> SampledModel:
        """Return the target's appearance: one histogram under an Epanechnikov kernel."""
        return SampledModel(image, region, state, self, Sampling(self.density))

    def build(self, rng: np.random.Generator) -> CloudTracker:
        """Return the tracker; its samples are drawn from the generator."""
        return CloudTracker(self, CloudMethod(self.model), rng)
