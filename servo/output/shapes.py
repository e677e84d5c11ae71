"""The scene as plain shapes, for recordings, which draw it without MuJoCo."""

from dataclasses import dataclass

import mujoco
import numpy as np

from sim.models.quaternion import matrix_of
from sim.models.target import SHOWN
from sim.types import Array, Image, Pose

KINDS = {
    mujoco.mjtGeom.mjGEOM_BOX: "box",
    mujoco.mjtGeom.mjGEOM_SPHERE: "ellipsoid",
    mujoco.mjtGeom.mjGEOM_ELLIPSOID: "ellipsoid",
    mujoco.mjtGeom.mjGEOM_CYLINDER: "cylinder",
    mujoco.mjtGeom.mjGEOM_CAPSULE: "capsule",
    mujoco.mjtGeom.mjGEOM_MESH: "mesh",
}
UNSET = (0.5, 0.5, 0.5, 1.0)
"""The colour of a geom that has none of its own; its material's holds then."""
LARGEST_SIDE = 800
"""Of a larger picture only every second pixel is taken, or every third [px]."""


@dataclass(frozen=True, slots=True)
class Surface:
    """Triangles, each with three vertices of its own."""

    vertices: Array
    """Points (3 m, 3) in the shape's frame [m]."""
    normals: Array
    """Directions (3 m, 3) that point outwards."""
    uv: Array | None = None
    """Where the vertices lie in the picture (3 m, 2): 0..1 from its left and from its top."""
    picture: Image | None = None
    """RGB (h, w, 3); None where all has one colour."""


@dataclass(frozen=True, slots=True)
class Shape:
    """One solid, fixed to a body."""

    name: str
    """Of its geom, without that of the model it comes from; maybe empty."""
    body: int
    """0 for the world, else the number of the body."""
    kind: str
    """box, ellipsoid, cylinder, capsule or mesh; a box with a picture is a mesh."""
    size: Array
    """Half sizes (3,): of the box or ellipsoid; radius, half length, unused for the others [m]."""
    pose: Pose
    """In the body's frame; the axis of cylinders and capsules is z."""
    rgba: Array
    """Colour (4,), 0..1."""
    surface: Surface | None = None
    """Of a mesh."""


def shapes_of(model: mujoco.MjModel) -> list[Shape]:
    """All solids of a model that are drawn, but the endless floor."""
    found: list[Shape] = []
    for g in range(model.ngeom):
        kind = KINDS.get(mujoco.mjtGeom(model.geom_type[g]))
        if kind is None or not SHOWN[model.geom_group[g]]:
            continue
        size = model.geom_size[g].copy()
        if model.geom_type[g] == mujoco.mjtGeom.mjGEOM_SPHERE:
            size[:] = size[0]
        pose = Pose(matrix_of(model.geom_quat[g]), model.geom_pos[g].copy())
        model_name, _, own = model.geom(g).name.partition("/")
        name = own or model_name
        body = int(model.geom_bodyid[g])
        rgba, surface = _appearance(model, g, kind)
        kind = kind if surface is None else "mesh"
        found.append(Shape(name, body, kind, size, pose, rgba, surface))
    return found


def _appearance(model: mujoco.MjModel, g: int, kind: str) -> tuple[Array, Surface | None]:
    """Colour (4,) and surface of a geom; a picture that does not lie on a surface is its mean
    colour.
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
    """The picture (h, w, 3) of a material, and whether it is a flat one."""
    role = mujoco.mjtTextureRole.mjTEXROLE_RGB
    texture = model.mat_texid[material, role] if material >= 0 else -1
    if texture < 0:
        return None, False
    start = int(model.tex_adr[texture])
    channels = int(model.tex_nchannel[texture])
    height = int(model.tex_height[texture])
    width = int(model.tex_width[texture])
    pixels = model.tex_data[start : start + height * width * channels]
    step = -(-max(height, width) // LARGEST_SIDE)
    picture = pixels.reshape(height, width, channels)[::step, ::step, :3]
    flat = model.tex_type[texture] == mujoco.mjtTexture.mjTEXTURE_2D
    return np.ascontiguousarray(np.broadcast_to(picture, (*picture.shape[:2], 3))), flat


def _box(half: Array, repeat: Array, picture: Image) -> Surface:
    """Six sides, on each of which the picture lies as MuJoCo lays it."""
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
