"""The geoms of a MuJoCo scene as Rerun's 3D shapes, and outlines of the target in a picture."""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
import rerun as rr

from sim.models.quaternion import matrix_of, quaternion_of
from sim.models.target import SHOWN
from sim.surroundings import WALLS
from sim.types import Array, Image, Pose

LINE_RADIUS = 0.6
"""Half the width of an outline [px]."""
KINDS = {
    mujoco.mjtGeom.mjGEOM_BOX: "box",
    mujoco.mjtGeom.mjGEOM_SPHERE: "ellipsoid",
    mujoco.mjtGeom.mjGEOM_ELLIPSOID: "ellipsoid",
    mujoco.mjtGeom.mjGEOM_CYLINDER: "cylinder",
    mujoco.mjtGeom.mjGEOM_CAPSULE: "capsule",
    mujoco.mjtGeom.mjGEOM_MESH: "mesh",
}
UNSET = (0.5, 0.5, 0.5, 1.0)
"""RGBA of a geom without a colour of its own: it has the colour of its material, if it has one."""
LARGEST_SIDE = 800
"""Longest side of a texture [px]; of a larger one only every second, third, ... pixel is taken."""


@dataclass(frozen=True, slots=True)
class Surface:
    """A mesh of m triangles, each with three vertices of its own: points (3 m, 3) [m] in the
    shape's frame, and outward normals (3 m, 3). With a texture `picture`, RGB (h, w, 3), the
    vertices have coordinates `uv` (3 m, 2) in it: 1 is its whole width or height, and it repeats
    beyond. Without a texture (None), the mesh has one colour.
    """

    vertices: Array
    """Points (3 m, 3) in the shape's frame [m]."""
    normals: Array
    """Directions (3 m, 3) that point outwards."""
    uv: Array | None = None
    """Texture coordinates of the vertices (3 m, 2), from the picture's left and top; 1 is its whole
    width or height, and it repeats beyond."""
    picture: Image | None = None
    """Texture, RGB (h, w, 3); None: the mesh has one colour."""


@dataclass(frozen=True, slots=True)
class Shape:
    """One visible geom of a MuJoCo model: its form, size [m] and colour RGBA (4,), 0..1, and its
    pose in the frame of the body to which it is fixed. `body` is the body's number in the model (0:
    the world); a mesh has a `surface`.
    """

    name: str
    """Name of the geom without the prefix of its model; may be empty."""
    body: int
    """Number of the body in the model; 0: the world."""
    kind: str
    """box, ellipsoid, cylinder, capsule or mesh; a box with a picture is a mesh."""
    size: Array
    """(3,) [m]: half sizes of a box or ellipsoid; radius, half length and an unused value of a
    cylinder or capsule; unused for a mesh."""
    pose: Pose
    """Pose of the geom in the body's frame; the axis of cylinders and capsules is z."""
    rgba: Array
    """Colour (4,), 0..1."""
    surface: Surface | None = None
    """Triangles of a mesh; None for other kinds."""


def shapes_of(model: mujoco.MjModel) -> list[Shape]:
    """Return all boxes, spheres, ellipsoids, cylinders, capsules and meshes of a MuJoCo model that
    are in a visible group of geoms, except for the walls, which would hide the scene.
    """
    found: list[Shape] = []
    for g in range(model.ngeom):
        kind = KINDS.get(mujoco.mjtGeom(model.geom_type[g]))
        if kind is None or model.geom(g).name == WALLS or not SHOWN[model.geom_group[g]]:
            continue
        size = model.geom_size[g].copy()
        if model.geom_type[g] == mujoco.mjtGeom.mjGEOM_SPHERE:
            size[:] = size[0]
        pose = Pose(matrix_of(model.geom_quat[g]), model.geom_pos[g].copy())
        model_name, _, own = model.geom(g).name.partition("/")
        body = int(model.geom_bodyid[g])
        rgba, surface = _appearance(model, g, kind)
        kind = kind if surface is None else "mesh"
        found.append(Shape(own or model_name, body, kind, size, pose, rgba, surface))
    return found


def _appearance(model: mujoco.MjModel, g: int, kind: str) -> tuple[Array, Surface | None]:
    """Return colour RGBA (4,), 0..1, and surface of geom `g`.

    Only meshes, and boxes with a flat texture, have a surface; that of other geoms is None. The
    colour of a geom whose texture cannot be drawn is multiplied by the mean of the texture.
    """
    rgba = model.geom_rgba[g].astype(float)
    material = model.geom_matid[g]
    if material >= 0 and tuple(rgba) == UNSET:
        rgba = model.mat_rgba[material].astype(float)
    picture, flat = _picture(model, material)
    surface = None
    if kind == "mesh":
        surface = _mesh(model, model.geom_dataid[g], picture if flat else None)
    elif kind == "box" and flat and picture is not None:
        surface = _box(model.geom_size[g], model.mat_texrepeat[material], picture)
    if picture is not None and (surface is None or surface.picture is None):
        rgba[:3] *= picture.mean(axis=(0, 1)) / 255
    return rgba, surface


def _picture(model: mujoco.MjModel, material: int) -> tuple[Image | None, bool]:
    """Return the texture of a material, RGB (h, w, 3) or None, and whether it is flat (2D)."""
    role = mujoco.mjtTextureRole.mjTEXROLE_RGB
    texture = model.mat_texid[material, role] if material >= 0 else -1
    if texture < 0:
        return None, False
    found = model.tex(int(texture))
    step = -(-max(found.data.shape[:2]) // LARGEST_SIDE)
    picture = found.data[::step, ::step, :3]
    flat = found.type[0] == mujoco.mjtTexture.mjTEXTURE_2D
    return np.ascontiguousarray(np.broadcast_to(picture, (*picture.shape[:2], 3))), flat


def _box(half: Array, repeat: Array, picture: Image) -> Surface:
    """Return the surface of a box with half sizes (3,) [m], textured on all six sides as by MuJoCo;
    `repeat` (2,) is how often the picture is repeated along a side.
    """
    around = np.array([[-1, -1], [1, -1], [1, 1], [-1, -1], [1, 1], [-1, 1]])
    vertices = np.zeros((3, 2, 6, 3))
    normals = np.zeros((3, 2, 6, 3))
    for axis, right, up in ((0, 1, 2), (1, 0, 2), (2, 0, 1)):
        for side, sign in enumerate((-1, 1)):
            vertices[axis, side, :, axis] = normals[axis, side, :, axis] = sign
            vertices[axis, side][:, [right, up]] = around
    uv = (1 + around * (1, -1)) / 2 * repeat
    return Surface(
        vertices.reshape(-1, 3) * half, normals.reshape(-1, 3), np.tile(uv, (6, 1)), picture
    )


def _mesh(model: mujoco.MjModel, mesh: int, picture: Image | None) -> Surface:
    begin = int(model.mesh_faceadr[mesh])
    faces = slice(begin, begin + int(model.mesh_facenum[mesh]))
    vertices = model.mesh_vert[model.mesh_vertadr[mesh] + model.mesh_face[faces].ravel()]
    normals = model.mesh_normal[model.mesh_normaladr[mesh] + model.mesh_facenormal[faces].ravel()]
    place = int(model.mesh_texcoordadr[mesh])
    if picture is None or place < 0:
        return Surface(vertices.astype(float), normals.astype(float))
    uv = model.mesh_texcoord[place + model.mesh_facetexcoord[faces].ravel()]
    return Surface(vertices.astype(float), normals.astype(float), uv.astype(float), picture)


def solids(shapes: list[Shape], bodies: Sequence[str]) -> Iterator[tuple[str, rr.AsComponents]]:
    """Yield pairs of entity path and Rerun archetype that draw shapes: one pair for each mesh, and
    one for all other shapes of the same kind on the same body. Wholly transparent shapes are left
    out.

    Args:
        shapes: The shapes.
        bodies: Entity path of each body, by its number in the model.
    """
    groups: dict[tuple[int, str], list[Shape]] = defaultdict(list)
    for number, shape in enumerate(s for s in shapes if s.rgba[3] > 0):
        if shape.surface is not None:
            path = rr.new_entity_path(["mesh", shape.name or f"{number}"])
            yield bodies[shape.body] + path, _mesh_archetype(shape)
        else:
            groups[shape.body, shape.kind].append(shape)
    for (body, kind), members in groups.items():
        yield f"{bodies[body]}/{kind}", _archetype(kind, members)


def entities(names: Sequence[str]) -> list[str]:
    """Return the path of a Rerun entity for each body of a MuJoCo model, in the order of `names`,
    the bodies' names.

    No path lies below the path of another body, because all poses are logged in the world frame and
    Rerun would apply both. "robot/yaw" becomes "world/robot/yaw" if there is no body "robot", else
    one part below "world" with its slash escaped; a body without a name becomes
    "world/body_NUMBER", with its place in `names` from 0.
    """
    found: list[str] = []
    for number, name in enumerate(names):
        group, _, rest = name.partition("/")
        parts = [group, rest] if rest and group not in names else [name or f"body_{number}"]
        found.append(rr.new_entity_path(["world", *parts]))
    return found


def _mesh_archetype(shape: Shape) -> rr.Mesh3D:
    surface = shape.surface
    assert surface is not None
    return rr.Mesh3D(
        vertex_positions=shape.pose.apply(surface.vertices),
        vertex_normals=surface.normals @ shape.pose.rotation.T,
        vertex_texcoords=surface.uv,
        albedo_texture=surface.picture,
        albedo_factor=shape.rgba,
    )


def _archetype(kind: str, members: list[Shape]) -> rr.AsComponents:
    sizes = np.stack([m.size for m in members])
    centres = np.stack([m.pose.translation for m in members])
    turned = [np.roll(quaternion_of(m.pose.rotation), -1) for m in members]
    style: dict[str, Any] = {
        "quaternions": [rr.Quaternion(xyzw=xyzw) for xyzw in turned],
        "colors": [m.rgba for m in members],
        "fill_mode": "solid",
    }
    if kind == "box":
        return rr.Boxes3D(half_sizes=sizes, centers=centres, **style)
    if kind == "ellipsoid":
        return rr.Ellipsoids3D(half_sizes=sizes, centers=centres, **style)
    if kind == "cylinder":
        return rr.Cylinders3D(radii=sizes[:, 0], lengths=2 * sizes[:, 1], centers=centres, **style)
    # The origin of a capsule is its first end in Rerun, and its centre in MuJoCo.
    begin = centres - np.stack([m.pose.rotation[:, 2] for m in members]) * sizes[:, 1:2]
    return rr.Capsules3D(radii=sizes[:, 0], lengths=2 * sizes[:, 1], translations=begin, **style)


def outline_strips(corners: Array) -> list[Array]:
    """Return the outline of a target with corners (4, 2) as two lines, in the corners' unit: a
    closed quadrangle (5, 2), and a tick (2, 2) that ends in the middle of the target's front side,
    which is between the second and third corner.
    """
    front = (corners[1] + corners[2]) / 2
    nose = np.stack([(corners.mean(axis=0) + front) / 2, front])
    return [np.vstack([corners, corners[:1]]), nose]


def outline(corners: Array, colour: tuple[int, int, int]) -> rr.LineStrips2D:
    """Return Rerun's archetype of the outline of a target with corners (4, 2) [px], in an RGB
    colour (0 to 255).
    """
    return rr.LineStrips2D(outline_strips(corners), colors=colour, radii=LINE_RADIUS)
