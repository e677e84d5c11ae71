"""Mean shift on the joint colour and texture histogram (Ning, Zhang, Zhang, Wu 2009)."""

from dataclasses import dataclass
from typing import Annotated, Any, Literal, cast

from annotated_types import Ge, Le

from sim.ranges import Share
from sim.types import Image
from tracking.appearance.local_patterns import THRESHOLD, TextureBins, texture_or_colour
from tracking.appearance.model import SampledModel, model_of
from tracking.settings import PLAIN
from tracking.trackers import mean_shift
from tracking.types import Region, State

PRESETS = {"paper": PLAIN | {"least_texture": 0.05, "steps": 15, "tolerance": 0.1}}


@dataclass(frozen=True)
class TextureSettings:
    """The texture's settings, over those of a tracker on one histogram."""

    levels: Literal[2, 4, 8, 16] = 8
    """Colour bins a channel: five times as many joint bins must have a number of 16 bits."""
    density: Annotated[int, Ge(2), Le(256)] = 24
    """Points along the kernel's diameter at which the image is read."""
    threshold: Annotated[float, Ge(-255), Le(255)] = THRESHOLD
    """How much brighter a neighbour must be for its bit to be 1 [grey levels]."""
    least_texture: Share = 0.25
    """With a smaller share of textured pixels in the target, colour alone is counted."""

    def model(self, image: Image, region: Region, state: State) -> SampledModel:
        """The target's appearance: one joint histogram; of colour alone if the target is smooth."""
        joint = TextureBins(self.levels, self.threshold)
        bins = texture_or_colour(image, region, state, joint, self.least_texture)
        learning = cast(Any, self)  # the other base of every subclass
        return model_of(image, region, state, bins, learning, density=self.density)


@dataclass(frozen=True, slots=True)
class Config(TextureSettings, mean_shift.Config):
    """Mean shift's settings, and the texture's."""
