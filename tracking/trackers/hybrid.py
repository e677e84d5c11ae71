"""Tracker: hybrid of Condensation and mean shift, in which every particle climbs (Maggio and
Cavallaro 2005).
"""

from dataclasses import dataclass

from tracking.settings import Count, Spread
from tracking.trackers import condensation
from tracking.trackers._cloud import CloudMethod, CloudSettings

PRESETS = {"paper": condensation.FILTER}


@dataclass(frozen=True, slots=True)
class Config(CloudSettings):
    """Settings of the particles and of their colour histogram, without annealing, with a prediction
    of constant velocity.
    """

    particles: Count = 100
    noise: Spread = 0.3

    @property
    def method(self) -> CloudMethod:
        return CloudMethod(climbs=True)
