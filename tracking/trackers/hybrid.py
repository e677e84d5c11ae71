"""Hybrid of Condensation and mean shift: every particle climbs (Maggio and Cavallaro 2005)."""

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Le

from sim.ranges import Share
from tracking.trackers import annealed, condensation

PRESETS = {"paper": condensation.FILTER}


@dataclass(frozen=True, slots=True)
class Config(annealed.Config):
    """One layer with unsharpened weights, constant velocity, and a short climb of each particle."""

    particles: Annotated[int, Ge(1), Le(100_000)] = 100
    velocity_memory: Share = 0.5
    scale_noise: Share = 0.0
    layers: Annotated[int, Ge(1), Le(50)] = 1
    """Number of annealing layers: one is no annealing."""
    schedule: annealed.Schedule = annealed.Schedule.FIXED
    """"fixed" with one layer weighs with the likelihood as it is."""
    climb: Annotated[int, Ge(1), Le(100)] = 6
    """Mean-shift histograms for each particle."""
