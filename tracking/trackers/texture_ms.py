"""Mean shift on the joint colour and texture histogram (Ning, Zhang, Zhang, Wu 2009)."""

from __future__ import annotations

from dataclasses import dataclass

from tracking.settings import PLAIN
from tracking.trackers import mean_shift
from tracking.trackers._texture import TextureSettings

PRESETS = {"paper": PLAIN | {"least_texture": 0.05, "steps": 15, "tolerance": 0.1}}


@dataclass(frozen=True, slots=True)
class Config(TextureSettings, mean_shift.Config):
    """Mean shift's settings, and the texture's."""
