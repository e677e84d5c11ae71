"""Tracker: mean shift on the joint colour and texture histogram (Ning, Zhang, Zhang, Wu 2009)."""

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Le

from tracking.appearance.layout import Sampling
from tracking.appearance.local_patterns import TextureSettings
from tracking.settings import DiscPoints
from tracking.trackers.mean_shift import Climb, ClimbSettings
from tracking.trackers.texture_pf import DENSITY, PAPERS

PRESETS = {"paper": PAPERS | {"steps": 15, "tolerance": 0.1, "scale": False}}
"""Steps and tolerance are those of the authors' program."""


@dataclass(frozen=True, slots=True)
class Config(TextureSettings, ClimbSettings):
    """Settings of mean shift on colour and texture: those of the joint histogram, which is read at
    `density` points along the kernel's diameter, the largest number of histograms read in one climb
    (`steps`), and whether the target's size is followed (`scale`).
    """

    density: DiscPoints = DENSITY
    """Points along the kernel's diameter at which the image is read."""
    steps: Annotated[int, Ge(1), Le(1000)] = 20
    """Most histograms read in one climb."""
    scale: bool = True
    """Also follow the target's size, by trying 10 % more and less."""

    @property
    def sampling(self) -> Sampling:
        return Sampling(self.density)

    @property
    def climb(self) -> Climb:
        return Climb(self.steps, scale=self.scale)
