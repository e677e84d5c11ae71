"""Tracker: single-kernel particle filter of the multi-kernel paper (Teuliere, Marchand, Eck).

It has one histogram for four dimensions: orientation is hardly observable, which is why the paper
has nine histograms.
"""

from dataclasses import dataclass

from tracking.appearance.layout import Sampling
from tracking.settings import PLAIN, CellPoints
from tracking.trackers.mk_pf import SimilaritySettings

PRESETS = {"paper": PLAIN | {"density": 48, "scatter": 0.0}}
"""The paper's: with so many points a side, every pixel of a common target is read."""


@dataclass(frozen=True, slots=True)
class Config(SimilaritySettings):
    """Settings of the single-kernel particle filter: those of the multiple-kernel one, with one
    cell, which is read at `density` points along each side.
    """

    density: CellPoints = 15
    """Points along each side of the template at which a particle reads the image."""

    @property
    def sampling(self) -> Sampling:
        return Sampling(self.density, cells=1)
