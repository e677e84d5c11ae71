"""PFJCTH: particle filter on the joint colour and texture histogram (Nagy, Ahmed, Zayed)."""

from dataclasses import dataclass

from sim.ranges import Share
from tracking.trackers import condensation
from tracking.trackers.texture_ms import PAPERS, TextureSettings

PRESETS = {"paper": PAPERS | {"estimate": "mean", "scatter": 0.0}}


@dataclass(frozen=True, slots=True)
class Config(TextureSettings, condensation.Config):
    """The particle filter's settings, and the texture's."""

    scale_noise: Share = 0.03
