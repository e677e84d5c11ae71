"""Single-kernel particle filter of the multi-kernel paper (Teuliere, Marchand, Eck).

One histogram, four dimensions: orientation is hardly observable, which is why the paper has nine.
"""

from dataclasses import dataclass

import numpy as np

from sim.ranges import Share
from sim.types import Image
from tracking.appearance.layout import Sampling
from tracking.appearance.model import SampledModel
from tracking.settings import (
    PLAIN,
    AppearanceSettings,
    CellPoints,
    Contrast,
    Count,
    ParticleSettings,
    Sharpness,
    Spread,
    Turn,
)
from tracking.trackers._cloud import CloudMethod, CloudTracker
from tracking.types import Region, State

PRESETS = {"paper": PLAIN | {"density": 48, "scatter": 0.0}}
"""The paper's: with so many points a side, every pixel of a common target is read."""


@dataclass(frozen=True, slots=True)
class Config(AppearanceSettings, ParticleSettings):
    """The multiple-kernel filter's settings with one cell."""

    particles: Count = 500
    gamma: Sharpness = 20.0
    noise: Spread = 0.08
    turn_noise: Turn = 0.04
    """Spread of theta per frame [rad]."""
    scale_noise: Share = 0.02
    """Spread of ln scale per frame."""
    contrast: Contrast = 0.5
    learn: bool = False
    density: CellPoints = 15
    """Points along each side of the template at which a particle reads the image."""

    def model(self, image: Image, region: Region, state: State) -> SampledModel:
        """Return the target's appearance: one histogram under a constant kernel."""
        return SampledModel(image, region, state, self, Sampling(self.density, cells=1))

    def build(self, rng: np.random.Generator) -> CloudTracker:
        """Return the tracker; its samples are drawn from the generator."""
        return CloudTracker(self, CloudMethod(self.model), rng)
