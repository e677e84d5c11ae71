"""PFJCTH: particle filter on the joint colour and texture histogram (Nagy, Ahmed, Zayed)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Le

from sim.types import Image
from tracking.appearance.local_patterns import THRESHOLD, TextureBins, texture_or_colour
from tracking.appearance.model import SampledModel, disc_model
from tracking.settings import PLAIN
from tracking.trackers import condensation
from tracking.types import Region, State

PRESETS = {"paper": PLAIN | {"least_texture": 0.05, "estimate": "mean"}}


@dataclass(frozen=True, slots=True)
class Config(condensation.Config):
    """The particle filter's settings, and the texture's."""

    scale_noise: Annotated[float, Ge(0), Le(1)] = 0.03
    """Spread of ln scale per frame; 0: the tracker keeps its size."""

    levels: Literal[2, 4, 8, 16] = 8
    """Colour bins a channel: five times as many joint bins must have a number of 16 bits."""
    density: Annotated[int, Ge(2), Le(256)] = 24
    """Points along the kernel's diameter at which the image is read."""
    threshold: Annotated[float, Ge(-255), Le(255)] = THRESHOLD
    """How much brighter a neighbour must be for its bit to be 1 [grey levels]."""
    least_texture: Annotated[float, Ge(0), Le(1)] = 0.25
    """With a smaller share of textured pixels in the target, colour alone is counted."""

    def model(self, image: Image, region: Region, state: State) -> SampledModel:
        """How the target looks: one joint histogram; of colour alone if the target is smooth."""
        joint = TextureBins(self.levels, self.threshold)
        bins = texture_or_colour(image, region, state, joint, self.least_texture)
        return disc_model(image, region, state, bins, self, density=self.density)

    def build(self, rng: np.random.Generator) -> condensation.Condensation:
        """The tracker; its samples are drawn from the generator."""
        return condensation.Condensation(self, rng)
