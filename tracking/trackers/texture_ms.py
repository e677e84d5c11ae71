"""Mean shift on the joint colour and texture histogram (Ning, Zhang, Zhang, Wu 2009)."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Le

from sim.ranges import Share
from sim.types import Image
from tracking.appearance.layout import Sampling
from tracking.appearance.model import SampledModel
from tracking.settings import AppearanceSettings, DiscPoints
from tracking.trackers._texture import (
    DENSITY,
    PAPERS,
    TextureLevels,
    TextureSettings,
    texture_bins,
)
from tracking.trackers.mean_shift import Climb, MeanShift
from tracking.types import Region, State

PRESETS = {"paper": PAPERS | {"steps": 15, "tolerance": 0.1, "scale": False}}
"""Steps and tolerance are those of the authors' program."""


@dataclass(frozen=True, slots=True)
class Config(AppearanceSettings, TextureSettings):
    """Histogram, texture and climb."""

    levels: TextureLevels = 8
    """Colour bins a channel; 1: texture alone."""
    density: DiscPoints = DENSITY
    """Points along the kernel's diameter at which the image is read."""
    steps: Annotated[int, Ge(1), Le(1000)] = 20
    """Most histograms read in one climb."""
    tolerance: Annotated[float, Ge(0.001), Le(1000)] = 0.2
    """A shorter shift ends the climb [px]."""
    velocity_memory: Share = 1.0
    """Share of the old velocity that the new one keeps; 1: begin where the target was last."""
    scale: bool = True
    """Also follow the target's size, by trying 10 % more and less."""

    def model(self, image: Image, region: Region, state: State) -> SampledModel:
        """Return the target's appearance: one joint histogram."""
        bins = texture_bins(image, region, state, self, self)
        return SampledModel(image, region, state, self, Sampling(self.density), bins)

    def build(self, rng: np.random.Generator) -> MeanShift:
        """Return the tracker; it draws nothing."""
        climb = Climb(self.tolerance, self.velocity_memory, self.steps, scale=self.scale)
        return MeanShift(self.model, climb)
