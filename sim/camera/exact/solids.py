"""Triangles of a MuJoCo model's geoms and sky, as MuJoCo draws them, each geom in its own frame."""

import mujoco
import numpy as np

from sim.types import Array

SHAPE = mujoco.mjtGeom
FLAT = 0.8
"""Smallest cosine between a vertex normal and the face's normal with which the vertex normal is
used (MuJoCo's rule); otherwise the face's is used, which keeps the edges of meshes without normals.
"""
USUAL_QUADS = 4
"""MuJoCo's own number of pieces along a side of a box or plane, for lights that change little over
it: one piece is then enough."""
REACH = 2.0
"""Half a side of the drawn part of an infinite plane, relative to the far clipping distance."""
NO_AREA = 1e-12
"""Twice the area below which a triangle of a surface of revolution is left out, such as those at a
pole, before the surface is scaled."""
CYLINDER = np.array([[0, -1], [1, -1], [1, -1], [1, 1], [1, 1], [0, 1]], float)
"""Radius and height of the points of a cylinder's profile (6, 2), with each rim twice."""
CYLINDER_NORMALS = np.array([[0, -1], [0, -1], [1, 0], [1, 0], [0, 1], [0, 1]], float)
TOP = np.array([[-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]], float)
"""The upper face of a box."""
SKY = np.array(
    [
        [[1, 0, 0], [0, 1, 0], [0, 0, -1]],
        [[-1, 0, 0], [0, -1, 0], [0, 0, -1]],
        [[0, 0, 1], [1, 0, 0], [0, -1, 0]],
        [[0, 0, -1], [1, 0, 0], [0, 1, 0]],
        [[0, -1, 0], [1, 0, 0], [0, 0, -1]],
        [[0, 1, 0], [-1, 0, 0], [0, 0, -1]],
    ],
    float,
)
"""For each face of the sky's cube, in the order of its pictures, three directions in the world (6,
3, 3): to the face's middle, along the rows of its picture to the right, and down its columns."""


Solid = Array
"""A surface of n triangles, counter-clockwise as seen from outside: a row for each corner, with its
position [m], unit normal, and texture coordinates, 0 to 1 over the picture (3 n, 8)."""


def solids_of(model: mujoco.MjModel) -> list[Solid]:
    """Return the triangles of each geom in a model, in the order of the geoms' ids: for a geom with
    n triangles an array (3 n, 8), a row for each corner, with position [m] and unit normal in the
    geom's own frame and texture coordinates. Seen from outside, a triangle's corners run
    counter-clockwise. A geom whose type cannot be drawn has no rows.
    """
    return [
        _mesh(model, geom) if kind == SHAPE.mjGEOM_MESH else _primitive(model, geom)
        for geom, kind in enumerate(model.geom_type)
    ]


def sky_of(side: int, far: float) -> Solid:
    """Return the 12 triangles of the sky, the inside of a cube around the camera along the world's
    axes, as an array (36, 8): a row for each corner, with position [m] relative to the camera, a
    normal towards the camera (not of unit length, as the sky shines by itself), and texture
    coordinates.

    Args:
        side: Side [px] of each of the six pictures of the cube's faces, which lie one below the
            other in the texture.
        far: Half a side of the cube [m].
    """
    corners = _split((SKY[:, :1] + TOP[:, :2] @ SKY[:, 1:]) * far)
    # From the middle of a border pixel to that of the other: a face's neighbours are other faces.
    across = 0.5 + (0.5 - 0.5 / side) * TOP[:, :2]
    places = np.stack([across + (0, k) for k in range(len(SKY))]) / (1, len(SKY))
    return np.column_stack([corners, -corners / far, _split(places)])


def texture_of(model: mujoco.MjModel, geom: int) -> int:
    """Return the index of the colour texture on a geom of a model (by the geom's id); -1 if it has
    none.
    """
    material = model.geom_matid[geom]
    if material < 0:
        return -1
    return int(model.mat_texid[material, mujoco.mjtTextureRole.mjTEXROLE_RGB])


def face_normals(corners: Array) -> Array:
    """Return a normal of each of n triangles (n, 3), whose length is twice the triangle's area
    [m^2] and which points to the side from which the corners run counter-clockwise. `corners` (3 n,
    3) [m] has three rows for each triangle.
    """
    a, b, c = corners.reshape(-1, 3, 3).transpose(1, 0, 2)
    return np.cross(b - a, c - a)


def _primitive(model: mujoco.MjModel, geom: int) -> Solid:
    kind = model.geom_type[geom]
    size = model.geom_size[geom].astype(float)
    slices = int(model.vis.quality.numslices)
    quads = int(model.vis.quality.numquads)
    quads = quads if quads > USUAL_QUADS else 1
    quarter = np.pi / 2 * np.linspace(0, 1, int(model.vis.quality.numstacks) // 2 + 1)
    angle = np.concatenate([-quarter[::-1], quarter])
    arc = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    match kind:
        case SHAPE.mjGEOM_PLANE:
            far = REACH * model.vis.map.zfar * model.stat.extent
            size = np.array([*np.where(size[:2] > 0, size[:2], far), 1.0])
            corners, normals = (rows[: 6 * quads**2] for rows in _box(quads))
            corners = (corners - (0, 0, 1)) * size
        case SHAPE.mjGEOM_BOX:
            corners, normals = _scaled(_box(quads), size)
        case SHAPE.mjGEOM_SPHERE | SHAPE.mjGEOM_ELLIPSOID:
            size = np.where(size > 0, size, size[0])
            corners, normals = _scaled(_turned(arc, arc, slices), size)
        case SHAPE.mjGEOM_CYLINDER:
            size = size[[0, 0, 1]]
            corners, normals = _scaled(_turned(CYLINDER, CYLINDER_NORMALS, slices), size)
        case SHAPE.mjGEOM_CAPSULE:
            # Two half balls; turning the line between their equators gives the wall.
            size = size[[0, 0, 1]]
            apart = np.repeat([-size[2], size[2]], len(quarter))
            ends = size[0] * arc + np.stack([0 * apart, apart], axis=1)
            corners, normals = _turned(ends, arc, slices)
        case _:
            corners = normals = np.zeros((0, 3))
    return np.column_stack([corners, normals, _mapped(model, geom, size, corners)])


Surface = tuple[Array, Array]
"""Corners (3 n, 3) and normals (3 n, 3)."""


def _scaled(surface: Surface, size: Array) -> Surface:
    corners, normals = surface
    # Normals scale with the inverse: that keeps them at right angles to the surface.
    normals = normals / size
    return corners * size, normals / np.linalg.norm(normals, axis=1, keepdims=True)


def _split(quads: Array) -> Array:
    """Return the corners (6 n, k) of the two triangles of each of n quadrilaterals (n, 4, k), three
    rows for each triangle.
    """
    return quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, quads.shape[2])


def _box(quads: int) -> Surface:
    """Return the surface of a cube with half sides of 1, whose upper face comes first.

    Args:
        quads: Number of pieces along each side of a face.
    """
    upper = [np.roll(TOP, k, axis=1) for k in range(3)]
    normals = np.roll(np.eye(3), 1, axis=0)[:, None] * np.ones((4, 1))
    faces = np.array([*upper, *(-face[::-1] for face in upper)])
    normals = np.concatenate([normals, -normals])
    if quads > 1:
        faces, normals = _divided(faces, quads), normals.repeat(quads**2, axis=0)
    return _split(faces), _split(normals)


def _divided(faces: Array, quads: int) -> Array:
    """Return n faces (n, 4, 3) in `quads` x `quads` pieces each, face by face, with the diagonals
    of OpenGL's pieces.
    """
    places = np.stack(np.divmod(np.arange(quads**2), quads), axis=1)[:, None]
    s, t = np.moveaxis((places + [[1, 0], [1, 1], [0, 1], [0, 0]]) / quads, 2, 0)[..., None]
    corner, along, _, across = np.moveaxis(faces, 1, 0)[:, :, None, None]
    return (corner + s * (along - corner) + t * (across - corner)).reshape(-1, 4, 3)


def _turned(points: Array, normals: Array, slices: int) -> Surface:
    """Return the surface of revolution of a profile around the z axis.

    Args:
        points: Radius and height of the profile's points (n, 2), upwards with the outside on the
            right.
        normals: Normals of the profile at these points (n, 2).
        slices: Number of pieces of a turn.
    """
    angle = 2 * np.pi / slices * np.arange(slices + 1)
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    turned = list[Array]()
    for profile in (points, normals):
        grid = np.empty((len(profile), slices + 1, 3))
        grid[..., :2] = profile[:, None, :1] * ring
        grid[..., 2] = profile[:, None, 1]
        quads = [grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]]
        turned.append(_split(np.stack(quads, axis=2).reshape(-1, 4, 3)))
    kept = np.repeat(np.linalg.norm(face_normals(turned[0]), axis=1) > NO_AREA, 3)
    return turned[0][kept], turned[1][kept]


def _mesh(model: mujoco.MjModel, geom: int) -> Solid:
    mesh = int(model.geom_dataid[geom])
    first = int(model.mesh_faceadr[mesh])
    faces = slice(first, first + int(model.mesh_facenum[mesh]))
    vertices = model.mesh_face[faces].ravel() + model.mesh_vertadr[mesh]
    outward = model.mesh_facenormal[faces].ravel() + model.mesh_normaladr[mesh]
    corners = model.mesh_vert[vertices].astype(float)
    normals = model.mesh_normal[outward].astype(float)
    start = int(model.mesh_texcoordadr[mesh])
    if start >= 0:
        places = model.mesh_facetexcoord[faces].ravel() + start
        return np.column_stack([corners, normals, model.mesh_texcoord[places]])
    flat = np.repeat(face_normals(corners), 3, axis=0)
    flat /= np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), np.finfo(float).tiny)
    differs = np.sum(flat * normals, axis=1, keepdims=True) < FLAT
    size = model.geom_size[geom].astype(float)
    normals = np.where(differs, flat, normals)
    return np.column_stack([corners, normals, _mapped(model, geom, size, corners)])


def _mapped(model: mujoco.MjModel, geom: int, size: Array, corners: Array) -> Array:
    """Return the texture coordinates (n, 2) of positions on a geom (n, 3), given in the geom's
    frame: the picture begins at the smallest x and the largest y. They are zeros if the geom has no
    texture.
    """
    if texture_of(model, geom) < 0:
        return np.zeros((len(corners), 2))
    material = model.geom_matid[geom]
    repeat = model.mat_texrepeat[material].astype(float)
    if model.mat_texuniform[material]:
        repeat = repeat * size[:2]
    return 0.5 * repeat * (1.0 + corners[:, :2] / size[:2] * (1.0, -1.0))
