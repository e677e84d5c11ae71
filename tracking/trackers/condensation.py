"""Tracker: Condensation, a particle filter on one colour histogram (Isard and Blake 1998; Perez et
al. 2002).
"""

from dataclasses import dataclass

from tracking.appearance.layout import Sampling
from tracking.settings import PLAIN, DiscPoints
from tracking.trackers._cloud import CloudSettings

FILTER: dict[str, object] = {
    **PLAIN,
    "noise": 1.0,
    "gamma": 20.0,
    "velocity_memory": 0.0,
    "scale_noise": 0.0,
    "scatter": 0.0,
}
"""The KAMS paper's particle filters with constant velocity. It does not give the noise: this is
half the largest motion per frame of its wildest sequences, for all filters alike. Its weights 1 - d
lose the target in every filter; these are the usual exp(-20 d^2).
"""
SAME = {"particles": 40}
"""The KAMS paper compares its filters with the same number of particles."""
PRESETS = {"paper": FILTER | SAME}


@dataclass(frozen=True, slots=True)
class Config(CloudSettings):
    """Settings of Condensation: those of its particles, and the lattice of points at which the
    image is read for their colour histogram, with `density` points along the kernel's diameter.
    """

    density: DiscPoints = 16
    """Points along the kernel's diameter at which the image is read."""

    @property
    def sampling(self) -> Sampling:
        return Sampling(self.density)
