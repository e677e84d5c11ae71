"""Pictures and colours on models: a box, and the material of a picture."""

from collections.abc import Sequence
from typing import Any

import cv2
import mujoco
import numpy as np

from sim.files.picture_file import read_image
from sim.targets._settings import file_of
from sim.types import Image

PICTURE = "picture"
LARGEST_SIDE = 2048
"""A larger picture is made smaller [px]: no camera sees more of it."""
PLAIN: dict[str, Any] = {"mass": 0, "contype": 0, "conaffinity": 0, "group": 2}
"""A geom that is seen and not touched."""


def picture_named(name: str, setting: str) -> Image:
    """A shipped picture by its bare name, or one of the user's by its path.

    Raises:
        ValueError: There is none of that name, or it cannot be read.
    """
    return read_image(file_of(name, ".png", setting))


def add_picture(spec: mujoco.MjSpec, picture: Image) -> str:
    """Add a picture to a model; the name of its material."""
    side = max(picture.shape[:2])
    if side > LARGEST_SIDE:
        scale = LARGEST_SIDE / side
        size = [max(1, round(n * scale)) for n in picture.shape[1::-1]]
        picture = cv2.resize(picture, size, interpolation=cv2.INTER_AREA).astype(np.uint8)
    height, width, channels = picture.shape
    texture = spec.add_texture(
        name=PICTURE,
        type=mujoco.mjtTexture.mjTEXTURE_2D,
        width=width,
        height=height,
        nchannel=channels,
    )
    texture.data = picture.tobytes()
    material = spec.add_material(name=PICTURE, specular=0, shininess=0)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = PICTURE
    return PICTURE


def box(size: Sequence[float], colour: Sequence[float], picture: Image | None) -> mujoco.MjSpec:
    """A box of this length, width and height [m] on the table.

    A picture lies on each of its sides: on the upper one its right is at the nose.
    """
    spec = mujoco.MjSpec()
    look: dict[str, Any] = {"rgba": colour}
    if picture is not None:
        look = {"material": add_picture(spec, picture)}
    half = np.array(size) / 2
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_BOX, size=half, pos=[0, 0, half[2]], **look, **PLAIN
    )
    return spec
