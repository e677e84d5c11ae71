"""Multiple-kernel particle filter (Teuliere, Marchand, Eck, section IV): a histogram a cell."""

from dataclasses import dataclass
from typing import Annotated, Any

from annotated_types import Ge, Le

from sim.ranges import Share
from sim.types import Image
from tracking.appearance.bins import ColourBins
from tracking.appearance.layout import Combine
from tracking.appearance.model import SampledModel, model_of
from tracking.settings import PLAIN, Sharpness
from tracking.trackers import annealed, condensation
from tracking.types import Region, State

VIDEO: dict[str, Any] = annealed.VIDEO | {
    "discriminate": True,
    "update": 0.05,
    "turn_noise": 0.0,
    "noise": 0.3,
    "scale_noise": 0.015,
    "velocity_memory": 1.0,
}
PRESETS = {"paper": PLAIN | {"density": 16, "scatter": 0.0}, "video": VIDEO}
"""The paper's: with so many points a side of a cell, every pixel of a common target is read."""


@dataclass(frozen=True, slots=True)
class Config(condensation.Config):
    """The particle filter's settings, in four dimensions, and the cells."""

    particles: Annotated[int, Ge(1), Le(100_000)] = 500
    gamma: Sharpness = 20.0
    """Sharpness of the likelihood exp(-gamma d_m^2) (equation 13)."""
    noise: Annotated[float, Ge(0), Le(10)] = 0.08
    turn_noise: Annotated[float, Ge(0), Le(4)] = 0.04
    """Spread of theta per frame [rad]."""
    scale_noise: Share = 0.02
    """Spread of ln scale per frame."""
    density: Annotated[int, Ge(1), Le(64)] = 5
    """Points along each side of a cell at which a particle reads the image."""
    cells: Annotated[int, Ge(1), Le(8)] = 3
    """Cells along each side: 3 is the paper's nine kernels."""
    combine: Combine = "mean"
    """Of the cells' squared distances: the mean, or the sum, as Perez et al. have it, which is the
    mean with so many times gamma."""
    contrast: Annotated[float, Ge(0), Le(100)] = 0.5
    discriminate: bool = False
    update: Share = 0.0
    """Share of the target's appearance that is new in each picture where it was found."""

    def model(self, image: Image, region: Region, state: State) -> SampledModel:
        """The target's appearance: a histogram for each cell."""
        return model_of(
            image,
            region,
            state,
            ColourBins(self.levels),
            self,
            per_side=self.cells,
            density=self.density,
            combine=self.combine,
            inset=self.inset,
        )
