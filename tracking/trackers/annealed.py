"""Tracker: annealed particle filter on one colour histogram (Deutscher, Blake, Reid 2000)."""

from dataclasses import dataclass

from sim.ranges import Share
from tracking.search.annealing import Annealing, Schedule
from tracking.settings import Count, Spread
from tracking.trackers import condensation
from tracking.trackers._cloud import CloudMethod, CloudSettings

LAYERS = 5
"""Number of layers: the KAMS paper numbers them from M = 4 down to 0."""
FIXED: dict[str, object] = condensation.FILTER | {
    "velocity_memory": 1.0,
    "schedule": Schedule.FIXED,
}
"""The annealing of the KAMS paper: no motion model."""
VIDEO: dict[str, object] = {"witness": True}
"""For recordings, where other things have the target's colours."""
PRESETS = {"paper": FIXED | condensation.SAME, "video": VIDEO}


@dataclass(frozen=True, slots=True)
class Config(CloudSettings):
    """Settings of the annealed particle filter: number of particles, standard deviations of
    position in the first layer (share of the target's size) and of ln scale, share of the old
    velocity in the new one, and schedule of the layers' exponents.
    """

    particles: Count = 100
    noise: Spread = 0.3
    """Spread of position in the first layer, over the target's size."""
    velocity_memory: Share = 1.0
    scale_noise: Share = 0.015
    schedule: Schedule = Schedule.SURVIVAL
    """"survival": exponents by the survival rate; "fixed": a geometric series."""

    @property
    def method(self) -> CloudMethod:
        return CloudMethod(Annealing(LAYERS, self.schedule))
