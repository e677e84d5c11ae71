"""The object to be followed: its model, and the reference rectangle that stands for it."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from sim.types import Array

OUTLINE = "outline"


@dataclass(frozen=True, slots=True)
class Target:
    """An object before it is put into the room.

    Its frame has x along the nose and z up; z = 0 is the table's top.
    """

    spec: mujoco.MjSpec
    """Its model, of which everything moves as one."""
    outline: Array
    """Corners (4, 3) of its reference rectangle in its frame [m]: level, in the order in which an
    image with the nose to the right shows them, from the top left clockwise."""
    found: bool = False
    """Whether the rectangle was found from what is seen from above, because nobody gave it."""


def rectangle(centre: Array, length: float, width: float) -> Array:
    """Corners (4, 3) of a level rectangle, in the order of `Target.outline`.

    Args:
        centre: Its middle (3,) [m].
        length: Along the target's x [m].
        width: Along the target's y [m].
    """
    a, b = length / 2, width / 2
    return centre + np.array([[-a, b, 0], [a, b, 0], [a, -b, 0], [-a, -b, 0]])


def dimensions(outline: Array) -> tuple[float, float, float]:
    """Length, width and height over the table [m] of a rectangle (4, 3)."""
    length, width = np.ptp(outline[:, :2], axis=0).tolist()
    return length, width, float(outline[0, 2])


def outline_site(spec: mujoco.MjSpec) -> Array | None:
    """The rectangle (4, 3) that a model's site `outline` names; None where it has no such site.

    Raises:
        ValueError: The site is turned against the model.
    """
    if spec.site(OUTLINE) is None:
        return None
    model = spec.copy().compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    site = data.site(OUTLINE)
    if not np.allclose(site.xmat, np.eye(3).ravel(), atol=1e-6):
        raise ValueError(f"the site '{OUTLINE}' is turned; it has to lie along the model's x and y")
    length, width, _ = 2 * model.site(OUTLINE).size
    return rectangle(site.xpos.copy(), length, width)
