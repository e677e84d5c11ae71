"""A mesh of an OBJ or STL file, scaled to a size, in one colour or with a picture."""

import importlib
from dataclasses import dataclass
from math import cos, radians, sin
from pathlib import Path
from typing import Any, Literal

import mujoco
import numpy as np
from numpy.typing import NDArray

from sim.files import reading
from sim.files.shipped import file_of
from sim.models.model_files import said_by_mujoco
from sim.models.target import Target
from sim.ranges import Degrees, File, Length
from sim.targets._paint import PLAIN, Colour, Outlined, add_picture, picture_named, rgba
from sim.types import Array, Image

Indices = NDArray[np.int64]
SUFFIXES = (".obj", ".stl")
UPRIGHT = {
    "z": np.eye(3),
    "y": np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]]),
    "x": np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0]]),
}
"""Rotations that take an axis of the file to the vertical."""
ACROSS = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
FLAT = 0.001
"""What is thinner lies this far over the table, which would show through it [m]."""


@dataclass(frozen=True, slots=True)
class Triangles:
    """A surface of triangles. No two vertices are the same; no triangle has two equal corners."""

    vertices: Array
    """Points (n, 3), in the file's unit."""
    faces: Indices
    """Three vertices of each triangle (m, 3), counter-clockwise as seen from outside."""
    places: Array | None = None
    """Places of the triangles' corners in a picture (m, 3, 2): 0..1 from its left and from its
    bottom; None where the file does not say."""


@dataclass(frozen=True, slots=True)
class Config(Outlined):
    """Which mesh, how large, and how it lies."""

    file: File = "duck"
    """A shipped mesh's name, or an .obj or .stl file."""
    size: Length | tuple[Length, Length, Length] = 0.2
    """Its longest horizontal side, or length along the nose, width and height [m]."""
    up: Literal["x", "y", "z"] = "z"
    """Axis of the file that points up."""
    turn_deg: Degrees = 0.0
    """Turned about the vertical by this, after its longer side was laid along the nose [deg]."""
    colour: Colour = "#e0b020"
    """As "#rrggbb", or red, green and blue from 0 to 1."""
    texture: File | None = None
    """A picture in place of the colour: a shipped one's name, or a file; the mesh says where it
    lies."""

    def build(self, rng: np.random.Generator) -> Target:
        """The target, centred, resting on the table; draws nothing.

        Raises:
            ValueError: A file cannot be read or is broken, or there is no such colour.
        """
        path = file_of(self.file, "targets", ".obj", "file")
        mesh = _seen_from_outside(read_mesh(path))
        picture = None if self.texture is None else picture_named(self.texture, "texture")
        colour = rgba(self.colour)
        try:
            return self.target(self._spec(mesh, colour, picture))
        except ValueError as error:
            raise ValueError(f"{path}: {said_by_mujoco(error)}") from None

    def _spec(self, mesh: Triangles, colour: list[float], picture: Image | None) -> mujoco.MjSpec:
        spec = mujoco.MjSpec()
        shape = spec.add_mesh(name="mesh", inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL)
        shape.uservert = self._placed(mesh.vertices).ravel()
        shape.userface = mesh.faces.ravel()
        look: dict[str, Any] = {"rgba": colour}
        if picture is not None:
            if mesh.places is None:
                raise ValueError("it does not say where the texture lies on it (vt)")
            look = {"material": add_picture(spec, picture)}
            shape.usertexcoord = (mesh.places * (1, -1) + (0, 1)).ravel()
            shape.userfacetexcoord = np.arange(mesh.faces.size)
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="mesh", **look, **PLAIN)
        return spec

    def _placed(self, vertices: Array) -> Array:
        """Vertices (n, 3) in the target's frame [m]."""
        points = vertices @ UPRIGHT[self.up].T
        length, width, _ = np.ptp(points, axis=0)
        if width > length:
            points = points @ ACROSS.T
        c = cos(radians(self.turn_deg))
        s = sin(radians(self.turn_deg))
        points = points @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
        extent = np.ptp(points, axis=0)
        if not extent[:2].max() > 0:
            raise ValueError("it has no length and no width")
        if isinstance(self.size, tuple):
            scale = np.divide(self.size, extent, out=np.ones(3), where=extent > 0)
        else:
            scale = np.full(3, self.size / extent[:2].max())
        points = points * scale
        low = points.min(axis=0)
        high = points.max(axis=0)
        points -= [*(low + high)[:2] / 2, low[2]]
        return points + (0, 0, max(0.0, FLAT - float(points[:, 2].max())))


def trimesh() -> Any:
    """Import trimesh, only now: it takes half a second."""
    return importlib.import_module("trimesh")


def read_mesh(path: Path) -> Triangles:
    """Return the surface in an OBJ or STL file.

    Raises:
        ValueError: It cannot be read, or has no triangle.
    """
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise ValueError(f"{path}: a mesh is an .obj or an .stl file")
    with reading.opened(path, "mesh") as file:
        try:
            found = trimesh().load_mesh(file, suffix[1:], process=False, skip_materials=True)
            vertices, same = np.unique(found.vertices, axis=0, return_inverse=True)
            faces = same.reshape(-1)[found.faces]
            if suffix == ".stl" and not len(faces):
                file.seek(0)
                file.read().decode("ascii")  # where it is no text, trimesh may take it for one
        except Exception:  # trimesh's readers raise what they meet in a broken file
            raise ValueError(f"{path}: this mesh is damaged, or not what its name says") from None
    broken = ~np.isfinite(vertices).all(axis=1)
    if broken.any():
        vertex = " ".join(f"{number:g}" for number in vertices[broken][0])
        raise ValueError(f"{path}: the vertex {vertex} is not finite")
    places: Array | None = getattr(found.visual, "uv", None)
    if places is not None:
        places = np.asarray(places)[found.faces]
    # Corners that fell together leave triangles without an area, which MuJoCo refuses.
    whole = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    if not whole.any():
        raise ValueError(f"{path}: there is no triangle in this mesh")
    return Triangles(vertices, faces[whole], None if places is None else places[whole])


def _seen_from_outside(mesh: Triangles) -> Triangles:
    """A closed mesh whose faces point outwards; of an open one both sides can be seen."""
    vertices = mesh.vertices
    places = mesh.places
    faces = mesh.faces[:, ::-1]
    turned = None if places is None else places[:, ::-1]
    shape: Any = trimesh().Trimesh(vertices, mesh.faces, process=False)
    if shape.is_watertight and shape.is_winding_consistent:
        return mesh if shape.volume >= 0 else Triangles(vertices, faces, turned)
    return Triangles(
        np.concatenate([vertices, vertices]),
        np.concatenate([mesh.faces, faces + len(vertices)]),
        None if places is None else np.concatenate([places, places[:, ::-1]]),
    )
