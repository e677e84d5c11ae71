"""Common parts of targets: settings of the reference rectangle, colours, pictures, and a box."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import mujoco
import numpy as np
from annotated_types import Ge, Le

from sim.files.picture_file import read_image
from sim.files.shipped import file_of
from sim.models.shapes import add_picture
from sim.models.target import Target, rectangle, target_of
from sim.ranges import Length, Share
from sim.types import Image

Colour = str | tuple[Share, Share, Share]
"""As "#rrggbb", or red, green and blue from 0 to 1."""
THIN = 0.002
"""Height of a plate or a tag on the table [m]."""
HEX = re.compile("#[0-9a-fA-F]{6}")


@dataclass(frozen=True, slots=True)
class Outlined:
    """Settings of a target whose reference rectangle (length, width, height [m]) is given, or found
    in its model.
    """

    outline: tuple[Length, Length, Annotated[float, Ge(0), Le(5)]] | None = None
    """Length along the nose, width, and height over the table of the reference rectangle [m]; by
    default those of the model's site `outline`, or that are found."""

    def target(self, spec: mujoco.MjSpec) -> Target:
        """Return the target with this model, and with the reference rectangle that the settings
        give, or else the one found in the model.

        Raises:
            ValueError: The model's site `outline` is not aligned with its axes, or no part of the
                target is seen from above.
        """
        target = target_of(spec)
        if self.outline is None:
            return target
        length, width, height = self.outline
        middle = np.append(target.outline.mean(axis=0)[:2], height)
        return Target(spec, rectangle(middle, length, width))


def rgba(colour: Colour) -> list[float]:
    """Return the red, green, blue and opacity, 0 to 1, of a colour setting.

    Raises:
        ValueError: The colour is a text other than "#rrggbb".
    """
    if not isinstance(colour, str):
        return [*colour, 1.0]
    if not HEX.fullmatch(colour):
        raise ValueError(
            f"colour = {colour!r}: this colour is not known: give '#rrggbb', or three numbers "
            "from 0 to 1"
        )
    return [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)] + [1.0]


PLAIN: dict[str, object] = {"mass": 0, "contype": 0, "conaffinity": 0, "group": 2}
"""A geom that is seen and not touched."""


def picture_named(name: str, setting: str) -> Image:
    """Return the picture of a setting as RGB (H, W, 3): a shipped one by its bare name, or a file.

    Raises:
        ValueError: The picture is missing or cannot be read.
    """
    return read_image(file_of(name, "targets", ".png", setting))


def box(size: Sequence[float], colour: Sequence[float], picture: Image | None) -> mujoco.MjSpec:
    """Return the model of a box with this length, width and height [m] that stands on z = 0.

    A picture (H, W, 3) lies on each of its sides: on the upper one its right is at the nose.
    Without one the box has the colour: red, green, blue and opacity, 0 to 1.
    """
    spec = mujoco.MjSpec()
    look: dict[str, object] = {"rgba": colour}
    if picture is not None:
        look = {"material": add_picture(spec, picture)}
    half = np.array(size) / 2
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_BOX, size=half, pos=[0, 0, half[2]], **look, **PLAIN
    )
    return spec
