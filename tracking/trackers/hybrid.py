"""Tracker: hybrid of Condensation and mean shift, in which every particle moves to a local maximum
of the similarity to the target before it is weighed (Maggio and Cavallaro 2005).
"""

from dataclasses import dataclass

from tracking.settings import Count, Spread
from tracking.trackers import condensation
from tracking.trackers._cloud import CloudMethod, CloudSettings

PRESETS = {"paper": condensation.FILTER}


@dataclass(frozen=True, slots=True)
class Config(CloudSettings):
    """Settings of the hybrid of Condensation and mean shift: number of particles, standard
    deviation of their position per frame (share of the target's size), and settings of any particle
    filter on a colour histogram.
    """

    particles: Count = 100
    noise: Spread = 0.3

    @property
    def method(self) -> CloudMethod:
        return CloudMethod(climbs=True)
