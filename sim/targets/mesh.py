"""Target: a mesh of an OBJ or STL file, scaled to a size, with its own materials, one colour, or
another picture.
"""

from dataclasses import dataclass, replace
from math import cos, radians, sin
from typing import Literal

import mujoco
import numpy as np

from sim.files.notices import notice
from sim.files.picture_name import picture_named
from sim.files.shipped import file_of
from sim.models.mesh_file import Material, Triangles, listed, read_mesh, trimesh
from sim.models.model_files import said_by_mujoco
from sim.models.paint import PLAIN, Colour, Outlined, rgba
from sim.models.shapes import show
from sim.models.target import Target
from sim.ranges import Degrees, File, Length
from sim.types import Array

UPRIGHT = {
    "z": np.eye(3),
    "y": np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]]),
    "x": np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0]]),
}
"""Rotations that take an axis of the file to the vertical."""
ACROSS = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
YELLOW = "#e0b020"
FLAT = 0.001
"""Height to which a thinner target is lifted over the table, which would show through it [m]."""


@dataclass(frozen=True, slots=True)
class Config(Outlined):
    """Settings of a target from a mesh file: the mesh; its longest horizontal side, or its length,
    width and height [m]; the file's axis that points up, and a turn about the vertical [deg]; and a
    colour or texture in place of the mesh's own.
    """

    file: File = "duck"
    """A shipped mesh's name, or an .obj or .stl file."""
    size: Length | tuple[Length, Length, Length] = 0.2
    """Longest horizontal side of the target, or its length along the nose, width and height [m]."""
    up: Literal["x", "y", "z"] = "z"
    """Axis of the file that points up."""
    turn_deg: Degrees = 0.0
    """Turn about the vertical, counter-clockwise as seen from above, after the longer side is laid
    along the nose [deg]."""
    colour: Colour | None = None
    """As "#rrggbb", or red, green and blue from 0 to 1; by default the colours and pictures of the
    .mtl that an OBJ file names, and yellow where it names none."""
    texture: File | None = None
    """A picture in place of the colours: a shipped one's name, a file, or "skimage:NAME"; the mesh
    says where it lies."""

    def build(self, rng: np.random.Generator) -> Target:
        """Return the target: the mesh, centred and resting on the table, with the reference
        rectangle that stands for it in control. `rng` is not used.

        Raises:
            ValueError: A file cannot be read or is broken, the mesh has no texture coordinates for
                the texture, all its points lie on one vertical line, or there is no such colour.
        """
        path = file_of(self.file, "targets", ".obj", "file")
        own = self.colour is None and self.texture is None
        mesh = _seen_from_outside(read_mesh(path, materials=own))
        if mesh.missing:
            notice(f"{path}: not drawn: {listed(mesh.missing)}")
        picture = None
        if self.texture is not None:
            picture = picture_named(self.texture, "targets", "texture")
        given = Material(tuple(rgba(self.colour or YELLOW)), picture)
        try:
            return self.target(self._spec(mesh, given, own=own))
        except ValueError as error:
            raise ValueError(f"{path}: {said_by_mujoco(error)}") from None

    def _spec(self, mesh: Triangles, given: Material, *, own: bool) -> mujoco.MjSpec:
        """Return the model of the target, with the mesh's own materials or a given one.

        Raises:
            ValueError: The given material has a picture, and the mesh no texture coordinates; or
                all vertices lie on one vertical line.
        """
        if given.picture is not None and mesh.places is None:
            raise ValueError(
                "the mesh has no texture coordinates (vt) for the texture: add them to the file, "
                "or leave texture out"
            )
        mesh = replace(mesh, vertices=self._placed(mesh.vertices))
        parts = mesh.parts() if own and any(mesh.materials) else [(mesh, given)]
        spec = mujoco.MjSpec()
        kind = mujoco.mjtGeom.mjGEOM_MESH
        geom = spec.worldbody.add_geom(type=kind, meshname="mesh", **PLAIN)
        painted = [(part, material or given) for part, material in parts]
        show(spec, spec.add_mesh(name="mesh"), [geom], painted)
        return spec

    def _placed(self, vertices: Array) -> Array:
        """Return the vertices (n, 3) of a mesh file in the target's frame [m]: turned, scaled,
        centred, and resting on z = 0.

        Raises:
            ValueError: All vertices lie on one vertical line.
        """
        points = vertices @ UPRIGHT[self.up].T
        length, width, _ = np.ptp(points, axis=0)
        if width > length:
            points = points @ ACROSS.T
        c = cos(radians(self.turn_deg))
        s = sin(radians(self.turn_deg))
        points = points @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
        extent = np.ptp(points, axis=0)
        if not extent[:2].max() > 0:
            raise ValueError(
                "all points of the mesh lie on one vertical line: choose another axis as up, or "
                "correct the file"
            )
        if isinstance(self.size, tuple):
            scale = np.divide(self.size, extent, out=np.ones(3), where=extent > 0)
        else:
            scale = np.full(3, self.size / extent[:2].max())
        points = points * scale
        low = points.min(axis=0)
        high = points.max(axis=0)
        points -= [*(low + high)[:2] / 2, low[2]]
        return points + (0, 0, max(0.0, FLAT - float(points[:, 2].max())))


def _seen_from_outside(mesh: Triangles) -> Triangles:
    """Return a closed mesh with its faces outwards; an open mesh with both sides of each face."""
    places = mesh.places
    behind = None if places is None else places[:, ::-1]
    faces = mesh.faces[:, ::-1]
    shape = trimesh().Trimesh(mesh.vertices, mesh.faces, process=False)
    if shape.is_watertight and shape.is_winding_consistent:
        return mesh if shape.volume >= 0 else replace(mesh, faces=faces, places=behind)
    return replace(
        mesh,
        vertices=np.concatenate([mesh.vertices, mesh.vertices]),
        faces=np.concatenate([mesh.faces, faces + len(mesh.vertices)]),
        places=None if places is None else np.concatenate([places, places[:, ::-1]]),
        looks=np.concatenate([mesh.looks, mesh.looks]),
    )
