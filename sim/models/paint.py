"""Common parts of targets: settings of the reference rectangle, colours, pictures, and models of
boxes.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import mujoco
import numpy as np
from annotated_types import Ge, Le

from sim.models.mesh_file import Material, Triangles
from sim.models.shapes import add_picture, show
from sim.models.target import Target, rectangle, target_of
from sim.ranges import Length, Share
from sim.types import Array, Image

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
        """Return the target with the model `spec`. Its reference rectangle has the length, width
        and height in these settings, about the centre of the rectangle found in the model; or, if
        the settings give none, it is the one found in the model.

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
    """Return red, green, blue and opacity (always 1), each 0 to 1, of a colour setting: a text
    "#rrggbb", or three numbers from 0 to 1.

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


SIDES = np.array(
    [
        [[1, 0, 0], [0, 1, 0]],
        [[1, 0, 0], [0, -1, 0]],
        [[0, 1, 0], [0, 0, 1]],
        [[0, -1, 0], [0, 0, 1]],
        [[-1, 0, 0], [0, 0, 1]],
        [[1, 0, 0], [0, 0, 1]],
    ]
)
"""For each side of a box the directions to the right and upwards of a picture on it, as seen from
outside (6, 2, 3): the upper side first."""
SQUARE = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
"""Corners of a picture to the right and upwards of its middle, from the lower left one."""
PLAIN: dict[str, object] = {"mass": 0, "contype": 0, "conaffinity": 0, "group": 2}
"""A geom that is seen and not touched."""


def box(size: Sequence[float], colour: Sequence[float], picture: Image | None) -> mujoco.MjSpec:
    """Return the MuJoCo model of a box that stands on z = 0, with its centre on the z axis.

    Args:
        size: Length along x, width along y and height [m].
        colour: Red, green, blue and opacity, 0 to 1, of a box without a picture.
        picture: Picture on the upper side, RGB (H, W, 3), its right at +x; None: no picture.
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


def pictured_box(size: Sequence[float], picture: Image) -> mujoco.MjSpec:
    """Return the MuJoCo model of a box that stands on z = 0, with a picture, RGB (H, W, 3), on each
    of its sides: upright on the walls, and on the upper side with its right at +x. `size` is length
    along x, width along y and height [m].

    It is a mesh, because MuJoCo mirrors a picture on two sides of a box.
    """
    outwards = np.cross(SIDES[:, 0], SIDES[:, 1])
    corners = (outwards[:, None] + SQUARE @ SIDES + (0, 0, 1)) * size / 2
    spec = mujoco.MjSpec()
    add_rectangles(spec, "box", corners, (SQUARE + 1) / 2, picture)
    return spec


def add_rectangles(
    spec: mujoco.MjSpec, name: str, corners: Array, places: Array, picture: Image
) -> None:
    """Add a mesh of n rectangles, which all show the same picture or parts of it, to a model. Each
    rectangle is seen from one side only.

    Args:
        spec: The model, which is changed.
        name: Name of the mesh, its geom and its material.
        corners: Corners of the rectangles (n, 4, 3) in the model's frame [m], counter-clockwise as
            seen from the visible side.
        places: Texture coordinates of the corners, the same for all rectangles (4, 2) or for each
            (n, 4, 2): 0..1 from the picture's left and from its bottom; beyond 0..1 the picture is
            repeated.
        picture: The picture, RGB (H, W, 3).
    """
    halves = np.array([[0, 1, 2], [0, 2, 3]])
    faces = 4 * np.arange(len(corners))[:, None, None] + halves
    of_each = np.broadcast_to(places, (len(corners), 4, 2))[:, halves]
    mesh = Triangles(corners.reshape(-1, 3), faces.reshape(-1, 3), of_each.reshape(-1, 3, 2))
    kind = mujoco.mjtGeom.mjGEOM_MESH
    geom = spec.worldbody.add_geom(name=name, type=kind, meshname=name, **PLAIN)
    show(spec, spec.add_mesh(name=name), [geom], [(mesh, Material((), picture))])
