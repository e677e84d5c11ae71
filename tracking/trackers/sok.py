"""Tracker: structured octal kernel (Naeem, Mills, Pridmore 2006), mean shift from nine places when
it is unsure.

If the confidence 1 - d falls below a threshold T, with d the distance of the histograms, eight more
searches by mean shift begin on a ring at twice the target's radius, so that the nine kernels cover
nine times its area; the best of the nine ends is the target.
"""

from dataclasses import dataclass

from sim.ranges import Share
from tracking.trackers import mean_shift
from tracking.trackers.mean_shift import Climb, ClimbSettings

PRESETS = mean_shift.PRESETS


@dataclass(frozen=True, slots=True)
class Config(ClimbSettings):
    """Settings of the structured octal kernel: those of the colour histogram and of the climb by
    mean shift, and the confidence, 0..1, below which eight more climbs begin around the target.
    """

    confidence: Share = 0.8
    """T: confidence 1 - d below which eight more climbs begin around the target."""

    @property
    def climb(self) -> Climb:
        return Climb(confidence=self.confidence)
