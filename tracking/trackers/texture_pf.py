"""Tracker: PFJCTH, a particle filter on the joint colour and texture histogram (Nagy, Ahmed,
Zayed).
"""

from dataclasses import dataclass

from sim.ranges import Share
from tracking.appearance.layout import Sampling
from tracking.appearance.local_patterns import TextureSettings
from tracking.settings import PLAIN
from tracking.trackers._cloud import CloudSettings

PAPERS: dict[str, object] = {**PLAIN, "rest": "discard", "least_texture": 0.05}
"""Settings that the papers on this histogram have in common."""
DENSITY = 24
"""Points along the kernel's diameter: more than for colour alone, because most have no texture."""
PRESETS = {"paper": PAPERS | {"scatter": 0.0}}


@dataclass(frozen=True, slots=True)
class Config(TextureSettings, CloudSettings):
    """Settings of the particle filter on colour and texture: those of its particles, such as the
    standard deviation of ln scale per frame (`scale_noise`), and those of the joint histogram.
    """

    scale_noise: Share = 0.03

    @property
    def sampling(self) -> Sampling:
        return Sampling(DENSITY)
