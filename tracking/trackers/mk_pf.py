"""Tracker: multiple-kernel particle filter (Teuliere, Marchand, Eck, section IV), with a histogram
for each cell of the template.
"""

from dataclasses import dataclass

from sim.ranges import Share
from tracking.appearance.layout import Combine, Sampling
from tracking.settings import (
    PLAIN,
    CellPoints,
    Contrast,
    Count,
    Sharpness,
    Spread,
    Turn,
)
from tracking.trackers import annealed
from tracking.trackers._cloud import CloudSettings

CELLS = 3
"""Cells along each side of the template: the nine kernels of Teuliere, Marchand, Eck."""
VIDEO: dict[str, object] = annealed.VIDEO | {
    "learn": True,
    "turn_noise": 0.0,
    "noise": 0.3,
    "scale_noise": 0.015,
    "velocity_memory": 1.0,
}
"""For recordings: those of `annealed`, without the angle, because filmed targets hardly turn."""
PRESETS = {"paper": PLAIN | {"density": 16, "scatter": 0.0}, "video": VIDEO}
"""The paper's: with so many points a side of a cell, every pixel of a common target is read."""


@dataclass(frozen=True)
class SimilaritySettings(CloudSettings):
    """Settings of the particle filters of Teuliere, Marchand, Eck, which follow position, angle and
    size: number of particles, sharpness `gamma` of their likelihood, and standard deviations per
    frame of position (share of the target's size), angle [rad] and ln scale. `contrast` and
    `learn` are those of `AppearanceSettings`.
    """

    particles: Count = 500
    gamma: Sharpness = 20.0
    """Sharpness of the likelihood exp(-gamma d_m^2) (equation 13)."""
    noise: Spread = 0.08
    turn_noise: Turn = 0.04
    """Spread of theta per frame [rad]."""
    scale_noise: Share = 0.02
    """Spread of ln scale per frame."""
    contrast: Contrast = 0.5
    learn: bool = False


@dataclass(frozen=True, slots=True)
class Config(SimilaritySettings):
    """Settings of the multiple-kernel particle filter: those of its particles in x, y, theta and
    scale, the number of points along each side of a cell of the template, and whether the cells'
    squared distances are combined by their mean or sum.
    """

    density: CellPoints = 5
    """Points along each side of a cell at which a particle reads the image."""
    combine: Combine = "mean"
    """The cells' squared distances are combined by their mean, or by their sum, as Perez et al.
    have it; the sum acts like the mean with gamma multiplied by the number of cells."""

    @property
    def sampling(self) -> Sampling:
        return Sampling(self.density, CELLS, combine=self.combine)
