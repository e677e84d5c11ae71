"""Kernel annealed mean shift (Naeem, Pridmore, Mills).

In each layer of an annealed particle filter every particle climbs to the nearest mode before it is
weighed.
"""

from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Ge, Le

from sim.ranges import Share
from tracking.settings import Sharpness
from tracking.trackers import annealed

PRESETS = {"paper": annealed.LAYERS | {"estimate": "mean"}}


@dataclass(frozen=True, slots=True)
class Config(annealed.Config):
    """The annealed filter's settings, with fewer particles, sharper weights, and mean shift."""

    particles: Annotated[int, Ge(1), Le(100_000)] = 40
    gamma: Sharpness = 100.0
    """Sharpness of the likelihood exp(-gamma d^2); the paper's 1 - d loses the target three times
    as often.
    """
    noise: Annotated[float, Ge(0), Le(10)] = 1.2
    scale_noise: Share = 0.0
    contrast: Annotated[float, Ge(0), Le(100)] = 0.0
    """Weight eta of the surrounding ring's likeness to the target. With a fixed size it only draws
    particles to places that stand out."""
    estimate: Literal["mean", "best"] = "best"
    climb: Annotated[int, Ge(1), Le(100)] = 6
    """Mean-shift histograms for each particle in each layer."""
