"""Settings of the joint colour and texture histogram, shared by the two trackers that use it."""

from dataclasses import dataclass
from typing import Annotated, Any

from annotated_types import Ge, Le

from sim.ranges import Share
from sim.types import Image
from tracking.appearance.bins import Bins, as_seen
from tracking.appearance.local_patterns import Rest, TextureBins, texture_or_colour
from tracking.settings import MOST_LEVELS, PLAIN, AppearanceSettings
from tracking.types import Region, State

PAPERS: dict[str, Any] = PLAIN | {"rest": "discard", "least_texture": 0.05}
"""Settings that the papers on this histogram have in common."""
DENSITY = 24
"""Points along the kernel's diameter: more than for colour alone, because most have no texture."""
TextureLevels = Annotated[int, Ge(1), Le(MOST_LEVELS)]


@dataclass(frozen=True)
class TextureSettings:
    """Settings of the textures that are counted."""

    neighbours: Annotated[int, Ge(5), Le(24)] = 8
    """Neighbours P of a pixel on the circle of its pattern; P - 3 textures count."""
    radius: Annotated[float, Ge(1), Le(8)] = 1.0
    """Radius R of that circle [px]; between pixels the image is interpolated bilinearly."""
    rest: Rest = "colour"
    """Pixels without major texture count as nothing ("discard"), as the papers have it, which does
    not see how many of them a box holds; as one bin of all ("bin"); or as a bin for each colour
    ("colour")."""
    least_texture: Share = 0.25
    """With a smaller share of textured pixels in the target, colour alone is counted."""


def texture_bins(
    image: Image,
    region: Region,
    state: State,
    colours: AppearanceSettings,
    texture: TextureSettings,
) -> Bins:
    """Return the bins for a target: joint ones; of colour alone if the target is smooth.

    Args:
        image: First picture, RGB (H, W, 3).
        region: The template.
        state: State of the target there.
        colours: Settings of its colours.
        texture: Settings of its texture.
    """
    joint = TextureBins(colours.levels, texture.neighbours, texture.radius, texture.rest)
    seen = as_seen(image, even=colours.even)
    return texture_or_colour(seen, region, state, joint, texture.least_texture)
