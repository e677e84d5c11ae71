"""The scene as plain shapes, for whoever draws it without MuJoCo."""

# pyright: reportAttributeAccessIssue=false
# MuJoCo's names come from compiled modules without stubs.
from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from sim.types import Array, Image, Pose

KINDS = {
    mujoco.mjtGeom.mjGEOM_BOX: "box",
    mujoco.mjtGeom.mjGEOM_SPHERE: "ellipsoid",
    mujoco.mjtGeom.mjGEOM_ELLIPSOID: "ellipsoid",
    mujoco.mjtGeom.mjGEOM_CYLINDER: "cylinder",
    mujoco.mjtGeom.mjGEOM_CAPSULE: "capsule",
}
TEXTURED = "table"


@dataclass(frozen=True, slots=True)
class Shape:
    """One solid, fixed to a body."""

    body: int
    """0 for the world, else the number of the body."""
    kind: str
    """box, ellipsoid, cylinder or capsule."""
    size: Array
    """Half sizes (3,): of the box or ellipsoid; radius, half length, unused for the others [m]."""
    pose: Pose
    """In the body's frame; the axis of cylinders and capsules is z."""
    rgba: Array
    """Colour (4,), 0..1."""


def shapes_of(model: mujoco.MjModel) -> list[Shape]:
    """All solids of a model but the textured table and the endless floor."""
    found: list[Shape] = []
    for g in range(model.ngeom):
        kind = KINDS.get(mujoco.mjtGeom(model.geom_type[g]))
        if kind is None or model.geom(g).name == TEXTURED:
            continue
        rotation = np.empty(9)
        mujoco.mju_quat2Mat(rotation, model.geom_quat[g])
        size = model.geom_size[g].copy()
        if model.geom_type[g] == mujoco.mjtGeom.mjGEOM_SPHERE:
            size[:] = size[0]
        pose = Pose(rotation.reshape(3, 3), model.geom_pos[g].copy())
        found.append(Shape(int(model.geom_bodyid[g]), kind, size, pose, model.geom_rgba[g].copy()))
    return found


def table_top(model: mujoco.MjModel) -> tuple[Array, Image]:
    """Corners (4, 3) of the table's upper face [m], counter-clockwise from above, and its texture
    (h, w, 3) at half size.
    """
    table = model.geom(TEXTURED)
    a, b, c = table.size
    corners = table.pos + np.array([[-a, -b, c], [a, -b, c], [a, b, c], [-a, b, c]])
    texture = model.tex("wood")
    start = int(texture.adr[0])
    height, width, depth = int(texture.height[0]), int(texture.width[0]), int(texture.nchannel[0])
    pixels = model.tex_data[start : start + height * width * depth].reshape(height, width, depth)
    return corners, np.ascontiguousarray(pixels[::2, ::2, :3])
