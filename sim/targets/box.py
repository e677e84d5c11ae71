"""Target: a box in one colour, or with one picture on all sides."""

from dataclasses import dataclass

import numpy as np

from sim.files.picture_name import picture_named
from sim.models.paint import Colour, box, pictured_box, rgba
from sim.models.target import Target, rectangle
from sim.ranges import File, Length


@dataclass(frozen=True, slots=True)
class Config:
    """Settings of a box: length, width, height [m], and a colour, or one picture on all sides."""

    size: tuple[Length, Length, Length] = (0.16, 0.1, 0.04)
    """Length along the nose, width, height [m]."""
    colour: Colour = "#b0305a"
    """As "#rrggbb", or red, green and blue from 0 to 1."""
    picture: File | None = None
    """Picture that all sides show, in place of the colour: a shipped one's name, a file, or
    "skimage:NAME"."""

    def build(self, rng: np.random.Generator) -> Target:
        """Return the target: the model of the box, and its upper side as the reference rectangle
        that stands for it in control. `rng` is not used.

        Raises:
            ValueError: There is no such colour or picture.
        """
        if self.picture is None:
            spec = box(self.size, rgba(self.colour), None)
        else:
            spec = pictured_box(self.size, picture_named(self.picture, "targets", "picture"))
        length, width, height = self.size
        return Target(spec, rectangle(np.array([0, 0, height]), length, width))
