"""Triangles of a model's geoms and sites, as MuJoCo draws them, each in its own frame."""

from collections.abc import Iterator
from dataclasses import dataclass

import mujoco
import numpy as np

from sim.types import Array

SHAPE = mujoco.mjtGeom
FLAT = 0.8
"""Cosine between a mesh's normal and its face's; where it is less, the face's is taken. This keeps
the edges of meshes that have no normals of their own, and is MuJoCo's rule."""
REACH = 2.0
"""Half a side of what is drawn of an endless plane, of how far the camera sees."""
NO_AREA = 1e-12
"""Triangles at a pole have none [unit size]."""


@dataclass(frozen=True, slots=True)
class Body:
    """A geom or a site: what decides its surface."""

    kind: int
    """An `mjtGeom`."""
    size: Array
    """MuJoCo's three sizes [m]."""
    mesh: int
    material: int
    """-1 where it has none; likewise the mesh."""


@dataclass(frozen=True, slots=True)
class Solid:
    """A surface as triangles: three rows for each, counter-clockwise as seen from outside."""

    corners: Array
    """(3 n, 3) [m]."""
    normals: Array
    """(3 n, 3), of length 1."""
    texture: Array
    """Place in the material's picture (3 n, 2), 0 to 1 in a picture that is not repeated."""


def bodies(model: mujoco.MjModel) -> Iterator[Body]:
    """All geoms of a model, then all its sites."""
    for kind, size, mesh, material in zip(
        model.geom_type, model.geom_size, model.geom_dataid, model.geom_matid, strict=True
    ):
        yield Body(int(kind), size.astype(float), int(mesh), int(material))
    for kind, size, material in zip(
        model.site_type, model.site_size, model.site_matid, strict=True
    ):
        yield Body(int(kind), size.astype(float), -1, int(material))


def solid_of(model: mujoco.MjModel, body: Body) -> Solid | None:
    """The surface of a geom or site; None for a kind that is not drawn."""
    if body.kind == SHAPE.mjGEOM_MESH:
        return _mesh(model, body)
    surface = _surface(model, body)
    if surface is None:
        return None
    corners, normals = surface
    return Solid(corners, normals, _mapped(model, body, corners))


def texture_of(model: mujoco.MjModel, material: int) -> int:
    """The picture of a material's colour; -1 where it has none."""
    if material < 0:
        return -1
    return int(model.mat_texid[material, mujoco.mjtTextureRole.mjTEXROLE_RGB])


Surface = tuple[Array, Array]
"""Corners (3 n, 3) and normals (3 n, 3)."""


def _surface(model: mujoco.MjModel, body: Body) -> Surface | None:
    size = body.size
    slices = int(model.vis.quality.numslices)
    stacks = int(model.vis.quality.numstacks) // 2
    match body.kind:
        case SHAPE.mjGEOM_PLANE:
            far = REACH * model.vis.map.zfar * model.stat.extent
            side = np.where(size[:2] > 0, size[:2], far)
            return _scaled(_square(2, 1.0, 0.0), np.array([*side, 1.0]))
        case SHAPE.mjGEOM_BOX:
            sides = [_square(axis, sign, 1.0) for axis in range(3) for sign in (-1.0, 1.0)]
            return _scaled(_joined(sides), size)
        case SHAPE.mjGEOM_SPHERE:
            return _scaled(_turned(_arc(-1, 1, 2 * stacks), slices), np.full(3, size[0]))
        case SHAPE.mjGEOM_ELLIPSOID:
            return _scaled(_turned(_arc(-1, 1, 2 * stacks), slices), size)
        case SHAPE.mjGEOM_CYLINDER:
            parts = [_turned(piece, slices) for piece in (_wall(), _disk(-1), _disk(1))]
            return _scaled(_joined(parts), size[[0, 0, 1]])
        case SHAPE.mjGEOM_CAPSULE:
            radius, half = size[:2]
            parts = [_scaled(_turned(_wall(), slices), size[[0, 0, 1]])]
            for sign in (-1, 1):
                cap = _turned(_arc(min(sign, 0), max(sign, 0), stacks), slices)
                corners, normals = _scaled(cap, np.full(3, radius))
                parts.append((corners + (0.0, 0.0, sign * half), normals))
            return _joined(parts)
        case _:
            return None


def _joined(parts: list[Surface]) -> Surface:
    corners, normals = zip(*parts, strict=True)
    return np.concatenate(corners), np.concatenate(normals)


def _scaled(surface: Surface, size: Array) -> Surface:
    corners, normals = surface
    normals = normals / size
    return corners * size, normals / np.linalg.norm(normals, axis=1, keepdims=True)


def _square(axis: int, sign: float, height: float) -> Surface:
    """A square of two triangles across an axis, that is seen from this side."""
    face = np.empty((4, 3))
    face[:, axis] = sign * height
    face[:, (axis + 1) % 3] = sign * np.array([-1.0, 1.0, 1.0, -1.0])
    face[:, (axis + 2) % 3] = [-1.0, -1.0, 1.0, 1.0]
    normal = np.zeros(3)
    normal[axis] = sign
    return _split(face[None]), np.tile(normal, (6, 1))


def _split(quads: Array) -> Array:
    """Two triangles for each quadrilateral (n, 4, 3)."""
    return quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)


Profile = tuple[Array, Array]
"""Points (n, 2) as radius and height with the outside on the right, and their normals (n, 2)."""


def _arc(low: int, high: int, stacks: int) -> Profile:
    """A part of a half circle, in quarters from the equator."""
    angle = np.pi / 2 * np.linspace(low, high, stacks + 1)
    points = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return points, points


def _wall() -> Profile:
    # One piece: MuJoCo cuts walls and ends into rings, whose colours differ under near lamps only.
    return np.array([[1.0, -1.0], [1.0, 1.0]]), np.array([[1.0, 0.0], [1.0, 0.0]])


def _disk(sign: int) -> Profile:
    radius = np.array([0.0, 1.0])[::-sign]
    return np.stack([radius, [sign, sign]], axis=1), np.tile([0.0, float(sign)], (2, 1))


def _turned(profile: Profile, slices: int) -> Surface:
    """Turn a profile around the z axis: two triangles for each of its pieces and each slice."""
    angle = 2 * np.pi / slices * np.arange(slices + 1)
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    corners, normals = (_split(_swept(points, ring)) for points in profile)
    area = np.cross(corners[1::3] - corners[::3], corners[2::3] - corners[::3])
    kept = np.repeat(np.linalg.norm(area, axis=1) > NO_AREA, 3)
    return corners[kept], normals[kept]


def _swept(points: Array, ring: Array) -> Array:
    radial = points[:, None, :1] * ring
    height = np.broadcast_to(points[:, None, 1:], (*radial.shape[:2], 1))
    grid = np.concatenate([radial, height], axis=2)
    quads = [grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]]
    return np.stack(quads, axis=2).reshape(-1, 4, 3)


def _mesh(model: mujoco.MjModel, body: Body) -> Solid:
    first = int(model.mesh_faceadr[body.mesh])
    faces = slice(first, first + int(model.mesh_facenum[body.mesh]))
    vertices = model.mesh_face[faces].ravel() + model.mesh_vertadr[body.mesh]
    outward = model.mesh_facenormal[faces].ravel() + model.mesh_normaladr[body.mesh]
    corners = model.mesh_vert[vertices].astype(float)
    normals = model.mesh_normal[outward].astype(float)
    start = int(model.mesh_texcoordadr[body.mesh])
    if start >= 0:
        places = model.mesh_facetexcoord[faces].ravel() + start
        return Solid(corners, normals, model.mesh_texcoord[places].astype(float))
    flat = np.cross(corners[1::3] - corners[::3], corners[2::3] - corners[::3])
    length = np.linalg.norm(flat, axis=1, keepdims=True)
    flat = np.repeat(flat / np.where(length > 0, length, 1), 3, axis=0)
    differs = np.sum(flat * normals, axis=1, keepdims=True) < FLAT
    return Solid(corners, np.where(differs, flat, normals), _mapped(model, body, corners))


def _mapped(model: mujoco.MjModel, body: Body, corners: Array) -> Array:
    """Texture coordinates by the place on the body: the picture lies across its x and y."""
    if texture_of(model, body.material) < 0:
        return np.zeros((len(corners), 2))
    size = body.size[:2]
    if body.kind in (SHAPE.mjGEOM_SPHERE, SHAPE.mjGEOM_CYLINDER, SHAPE.mjGEOM_CAPSULE):
        size = body.size[[0, 0]]
    scale = np.where(size > 0, size, 1.0)
    repeat = model.mat_texrepeat[body.material].astype(float)
    if model.mat_texuniform[body.material]:
        repeat = repeat * scale
    return 0.5 * repeat * corners[:, :2] / scale * (1.0, -1.0) - 0.5
