"""Hybrid of Condensation and mean shift: every particle climbs (Maggio and Cavallaro 2005)."""

from dataclasses import dataclass

import numpy as np

from sim.types import Image
from tracking.appearance.layout import Sampling
from tracking.appearance.model import SampledModel
from tracking.settings import AppearanceSettings, Count, ParticleSettings, Spread
from tracking.trackers import condensation
from tracking.trackers._cloud import CloudMethod, CloudTracker
from tracking.types import Region, State

PRESETS = {"paper": condensation.FILTER}


@dataclass(frozen=True, slots=True)
class Config(AppearanceSettings, ParticleSettings):
    """Particles and histogram; unsharpened weights, constant velocity."""

    particles: Count = 100
    noise: Spread = 0.3

    def model(self, image: Image, region: Region, state: State) -> SampledModel:
        """Return the target's appearance: one histogram under an Epanechnikov kernel."""
        return SampledModel(image, region, state, self, Sampling())

    def build(self, rng: np.random.Generator) -> CloudTracker:
        """Return the tracker; its samples are drawn from the generator."""
        return CloudTracker(self, CloudMethod(self.model, climbs=True), rng)
