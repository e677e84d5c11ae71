"""PFJCTH: particle filter on the joint colour and texture histogram (Nagy, Ahmed, Zayed)."""

from dataclasses import dataclass

import numpy as np

from sim.ranges import Share
from sim.types import Image
from tracking.appearance.layout import Sampling
from tracking.appearance.model import SampledModel
from tracking.settings import AppearanceSettings, ParticleSettings
from tracking.trackers._cloud import CloudMethod, CloudTracker
from tracking.trackers._texture import (
    DENSITY,
    PAPERS,
    TextureLevels,
    TextureSettings,
    texture_bins,
)
from tracking.types import Region, State

PRESETS = {"paper": PAPERS | {"scatter": 0.0}}


@dataclass(frozen=True, slots=True)
class Config(AppearanceSettings, ParticleSettings, TextureSettings):
    """The particle filter's settings, and the texture's."""

    levels: TextureLevels = 8
    """Colour bins a channel; 1: texture alone."""
    scale_noise: Share = 0.03

    def model(self, image: Image, region: Region, state: State) -> SampledModel:
        """Return the target's appearance: one joint histogram."""
        bins = texture_bins(image, region, state, self, self)
        return SampledModel(image, region, state, self, Sampling(DENSITY), bins)

    def build(self, rng: np.random.Generator) -> CloudTracker:
        """Return the tracker; its samples are drawn from the generator."""
        return CloudTracker(self, CloudMethod(self.model), rng)
