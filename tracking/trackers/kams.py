"""Tracker: kernel annealed mean shift (Naeem, Pridmore, Mills).

In each layer of an annealed particle filter every particle moves by mean shift to a local maximum
of the similarity to the target before it is weighed.
"""

from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Ge, Le

from sim.ranges import Share
from tracking.appearance.layout import Kernel, Sampling
from tracking.search.annealing import Annealing, Schedule
from tracking.settings import Contrast, Count, Sharpness, Spread
from tracking.trackers import annealed
from tracking.trackers._cloud import CloudMethod, CloudSettings

PRESETS = {"paper": annealed.FIXED | {"estimate": "mean"}}


@dataclass(frozen=True, slots=True)
class Config(CloudSettings):
    """Settings of kernel annealed mean shift: number of particles, sharpness `gamma` of their
    likelihood, standard deviation of position in the first layer (share of the target's size),
    kernel, number and schedule of the layers, and whether the mean or the best particle is
    reported. `velocity_memory` and `contrast` are those of `ParticleSettings` and
    `AppearanceSettings`.
    """

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
    """The reported state: the weighted mean of the particles, or the best of them."""
    layers: Annotated[int, Ge(1), Le(50)] = annealed.LAYERS
    """Number of annealing layers."""
    schedule: Schedule = Schedule.SURVIVAL
    """"survival": exponents by the survival rate; "fixed": a geometric series."""

    @property
    def sampling(self) -> Sampling:
        return Sampling(kernel=self.kernel)

    @property
    def method(self) -> CloudMethod:
        layers = Annealing(self.layers, self.schedule)
        return CloudMethod(layers, climbs=True, best=self.estimate == "best")
