"""Structured octal kernel (Naeem, Mills, Pridmore 2006): mean shift from nine places when unsure.

Where 1 - d falls below T, eight more climbs begin on a ring at twice the target's radius, so that
the nine kernels cover nine times its area; the best of nine is the target.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Le

from sim.ranges import Share
from sim.types import Image
from tracking.appearance.layout import Sampling
from tracking.appearance.model import SampledModel
from tracking.settings import AppearanceSettings
from tracking.trackers import mean_shift
from tracking.trackers.mean_shift import Climb, MeanShift
from tracking.types import Region, State

PRESETS = mean_shift.PRESETS


@dataclass(frozen=True, slots=True)
class Config(AppearanceSettings):
    """Histogram and climb, with the confidence below which it searches around the target."""

    tolerance: Annotated[float, Ge(0.001), Le(1000)] = 0.2
    """A shorter shift ends the climb [px]."""
    velocity_memory: Share = 1.0
    """Share of the old velocity that the new one keeps; 1: begin where the target was last."""
    confidence: Share = 0.8
    """T: below this 1 - d, eight more climbs begin around the target."""

    def model(self, image: Image, region: Region, state: State) -> SampledModel:
        """Return the target's appearance: one histogram under an Epanechnikov kernel."""
        return SampledModel(image, region, state, self, Sampling())

    def build(self, rng: np.random.Generator) -> MeanShift:
        """Return the tracker; it draws nothing."""
        climb = Climb(self.tolerance, self.velocity_memory, confidence=self.confidence)
        return MeanShift(self.model, climb)
