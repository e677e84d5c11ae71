"""Settings that several trackers share; a tracker's own `Config` adds to them."""

from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

import numpy as np
from annotated_types import Ge, Le

from sim.ranges import Share
from sim.types import Array, Image
from tracking.appearance.bins import MOST_LEVELS, ColourBins
from tracking.appearance.layout import Kernel
from tracking.appearance.model import SampledModel, model_of
from tracking.appearance.reference import Learning
from tracking.hot.colour_labels import evened
from tracking.lock import LockConfig
from tracking.recognition import Recognition
from tracking.types import Region, State

PLAIN: dict[str, Any] = {"contrast": 0.0, "discriminate": False, "update": 0.0}
"""What no paper has: part of their presets."""
LEAST = 1e-12
DARK = 8
"""Pixels about as dark as this have no colour worth the name."""
Levels = Annotated[int, Ge(2), Le(MOST_LEVELS)]
Inset = Annotated[float, Ge(0), Le(0.49)]
Sharpness = Annotated[float, Ge(1e-6), Le(1e6)]
"""Of a likelihood: gamma in exp(-gamma d^2)."""


@dataclass(frozen=True)
class Colours:
    """How colours are seen and counted."""

    levels: Levels = 8
    """Colour bins a channel; the KAMS paper has 10."""
    even: bool = False
    """See colours as if all were lit alike: each pixel over its largest channel. Holds where the
    light changes, at the price of telling bright things from dark ones less well."""
    inset: Inset = 0.0
    """Share of the region's width and height that is left out, half on each side: there the
    background shows, whose change would be taken for the target's."""

    def view(self, image: Image) -> Image:
        """The picture as the tracker sees it."""
        return evened(image, DARK) if self.even else image


@dataclass(frozen=True, slots=True)
class DiscSettings(Colours, Learning):
    """One histogram of the target under an Epanechnikov kernel."""

    contrast: Annotated[float, Ge(0), Le(100)] = 0.25
    discriminate: bool = True
    update: Share = 0.05
    density: Annotated[int, Ge(2), Le(256)] = 16
    """Points along the kernel's diameter at which the image is read."""
    kernel: Kernel = "epanechnikov"
    """1 - r^2, or "linear": 1 - r, as the KAMS paper has it; cells have a constant one."""
    lock: LockConfig = field(default_factory=lambda: LockConfig(floor=0.5, cap=0.75))
    """When the target counts as hidden or lost; a hard-binned distance is never near 0."""

    def model(self, image: Image, region: Region, state: State) -> SampledModel:
        """The target's appearance: one histogram under an Epanechnikov kernel."""
        return model_of(
            image,
            region,
            state,
            ColourBins(self.levels),
            self,
            density=self.density,
            kernel=self.kernel,
            inset=self.inset,
        )


@dataclass(frozen=True, slots=True)
class CloudSettings(DiscSettings, Recognition):
    """A particle filter on one histogram."""

    particles: Annotated[int, Ge(1), Le(100_000)] = 200
    """Number of particles."""
    gamma: Sharpness = 50.0
    """Sharpness of the likelihood exp(-gamma d^2)."""
    likelihood: Literal["exponential", "linear"] = "exponential"
    """exp(-gamma d^2), or 1 - d as Naeem, Pridmore and Mills have it (equation 8)."""
    noise: Annotated[float, Ge(0), Le(10)] = 0.15
    """Spread of position per frame, over the target's size."""
    turn_noise: Annotated[float, Ge(0), Le(4)] = 0.0
    """Spread of theta per frame [rad]; 0: the tracker does not turn."""
    scale_noise: Share = 0.0
    """Spread of ln scale per frame; 0: the tracker keeps its size."""
    velocity_memory: Share = 0.5
    """Share of the old velocity that the new one keeps; 1: a random walk without velocity."""
    estimate: Literal["mean", "best"] = "mean"
    """The weighted mean of the particles, or the best of them."""
    widen_when_lost: Annotated[float, Ge(1), Le(100)] = 3.0
    """Factor on the spread while the target is LOST."""
    scatter: Share = 0.7
    """Share of the particles that is strewn over the whole picture while the target is LOST."""

    def log_likelihood(self, energy: Array) -> Array:
        """Logarithm (N,) of the likelihood of states with this energy (N,), d^2 and more."""
        if self.likelihood == "linear":
            return np.log(np.maximum(1 - np.sqrt(energy), LEAST))
        return -self.gamma * energy
