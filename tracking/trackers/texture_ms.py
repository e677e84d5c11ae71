"""Mean shift on the joint colour and texture histogram (Ning, Zhang, Zhang, Wu 2009)."""

from dataclasses import dataclass
from typing import Annotated, Any, cast

from annotated_types import Ge, Le

from sim.ranges import Share
from sim.types import Image
from tracking.appearance.bins import MOST_LEVELS
from tracking.appearance.local_patterns import THRESHOLD, Rest, TextureBins, texture_or_colour
from tracking.appearance.model import SampledModel, model_of
from tracking.settings import PLAIN
from tracking.trackers import mean_shift
from tracking.types import Region, State

PAPERS: dict[str, Any] = PLAIN | {"rest": "discard", "least_texture": 0.05}
PRESETS = {"paper": PAPERS | {"steps": 15, "tolerance": 0.1, "scale": False}}


@dataclass(frozen=True)
class TextureSettings:
    """The texture's settings, over those of a tracker on one histogram."""

    levels: Annotated[int, Ge(1), Le(MOST_LEVELS)] = 8
    """Colour bins a channel; 1: texture alone."""
    density: Annotated[int, Ge(2), Le(256)] = 24
    """Points along the kernel's diameter at which the image is read."""
    threshold: Annotated[float, Ge(-255), Le(255)] = THRESHOLD
    """How much brighter a neighbour must be for its bit to be 1 [grey levels]."""
    neighbours: Annotated[int, Ge(5), Le(24)] = 8
    """Neighbours P of a pixel on the circle of its pattern; P - 3 textures count."""
    radius: Annotated[float, Ge(1), Le(8)] = 1.0
    """Radius R of that circle [px]; between pixels the image is interpolated bilinearly."""
    rest: Rest = "colour"
    """What pixels without major texture count as: "discard", nothing, as the papers have it, which
    does not see how many of them a box holds; "bin", one bin of all; "colour", a bin for each
    colour."""
    least_texture: Share = 0.25
    """With a smaller share of textured pixels in the target, colour alone is counted."""

    def model(self, image: Image, region: Region, state: State) -> SampledModel:
        """The target's appearance: one joint histogram; of colour alone if the target is smooth."""
        joint = TextureBins(self.levels, self.threshold, self.neighbours, self.radius, self.rest)
        bins = texture_or_colour(image, region, state, joint, self.least_texture)
        disc = cast(Any, self)  # the other base of every subclass
        return model_of(
            image,
            region,
            state,
            bins,
            disc,
            density=self.density,
            kernel=disc.kernel,
            inset=disc.inset,
        )


@dataclass(frozen=True, slots=True)
class Config(TextureSettings, mean_shift.Config):
    """Mean shift's settings, and the texture's."""

    scale: bool = True
