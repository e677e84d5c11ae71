"""Kernel annealed mean shift (Naeem, Pridmore, Mills).

In each layer of an annealed particle filter every particle climbs to the nearest mode before it is
weighed.
"""

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Le

from sim.ranges import Share
from sim.types import Image
from tracking.appearance.layout import Kernel, Sampling
from tracking.appearance.model import SampledModel
from tracking.search.annealing import Annealing, Schedule
from tracking.settings import (
    AppearanceSettings,
    Contrast,
    Count,
    ParticleSettings,
    Sharpness,
    Spread,
)
from tracking.trackers import annealed
from tracking.trackers._cloud import CloudMethod, CloudTracker
from tracking.types import Region, State

PRESETS = {"paper": annealed.FIXED | {"estimate": "mean"}}


@dataclass(frozen=True, slots=True)
class Config(AppearanceSettings, ParticleSettings):
    """The annealed filter's settings, with fewer particles and sharper weights."""

    particles: Count = 40
    gamma: Sharpness = 100.0
    """Sharpness of the likelihood exp(-gamma d^2); the paper's 1 - d loses the target three times
    as often."""
    noise: Spread = 1.2
    """Spread of position in the first layer, over the target's size."""
    velocity_memory: Share = 1.0
    contrast: Contrast = 0.0
    """Weight eta of the surrounding ring's likeness to the target. With a fixed size it only draws
    particles to places that stand out."""
    kernel: Kernel = "epanechnikov"
    """1 - r^2, or "linear": 1 - r, as the paper has it."""
    estimate: Literal["mean", "best"] = "best"
    """The weighted mean of the particles, or the best of them."""
    layers: Annotated[int, Ge(1), Le(50)] = annealed.LAYERS
    """Number of annealing layers."""
    schedule: Schedule = Schedule.SURVIVAL
    """"survival": exponents by the survival rate; "fixed": a geometric series."""

    def model(self, image: Image, region: Region, state: State) -> SampledModel:
        """Return the target's appearance: one histogram under the kernel."""
        return SampledModel(image, region, state, self, Sampling(kernel=self.kernel))

    def build(self, rng: np.random.Generator) -> CloudTracker:
        """Return the tracker; its samples are drawn from the generator."""
        layers = Annealing(self.layers, self.schedule)
        best = self.estimate == "best"
        return CloudTracker(self, CloudMethod(self.model, layers, climbs=True, best=best), rng)
