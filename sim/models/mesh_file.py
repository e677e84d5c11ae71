"""Reading of the triangles and materials in a mesh file, by the package trimesh."""

import contextlib
import importlib
import re
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path, PureWindowsPath
from types import ModuleType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from sim.files import reading
from sim.files.picture_file import read_image
from sim.types import Array, Image

Indices = NDArray[np.int64]
OBJ = ".obj"
COLLADA = ".dae"
SUFFIXES = (OBJ, ".stl")
"""Files that may be a target."""
USED = re.compile(rb"^usemtl\s+(\S.*?)\s*$", re.MULTILINE)
"""The name of a material in an OBJ file."""
LIBRARY = re.compile(rb"^(?:\xef\xbb\xbf)?\s*mtllib\s+(\S.*?)\s*$", re.MULTILINE)
"""The name of a file of materials in an OBJ file."""
SHOWN = 4
"""Largest number of names in a sentence."""
Lost = tuple[str, str]
"""Something that a file names, and the reason why it is left out."""


@dataclass(frozen=True, slots=True)
class Material:
    """The look of some triangles of a mesh: a colour (red, green, blue and opacity, 0 to 1), or a
    picture, RGB (H, W, 3), which then replaces the colour.
    """

    colour: tuple[float, ...]
    """Red, green, blue and opacity, 0 to 1."""
    picture: Image | None = None
    """A picture in place of the colour."""


@dataclass(frozen=True, slots=True)
class Triangles:
    """A surface of m triangles with n vertices: points (n, 3), in the unit of the mesh file, or in
    m if the file states its unit; three vertex numbers per triangle (m, 3), counter-clockwise as
    seen from outside; texture coordinates (m, 3, 2), 0..1 from the picture's left and bottom (None:
    unknown); material numbers (m,); and materials and pictures that could not be read (`missing`).

    In a surface from `read_mesh` no two vertices are the same, and no triangle has two equal
    corners.
    """

    vertices: Array
    """Points (n, 3), in the file's unit; of Collada in m."""
    faces: Indices
    """Three vertices of each triangle (m, 3), counter-clockwise as seen from outside."""
    places: Array | None = None
    """Places of the triangles' corners in a picture (m, 3, 2): 0..1 from its left and from its
    bottom; None where the file does not say."""
    looks: Indices = field(default_factory=lambda: np.zeros(0, np.int64))
    """The number of each triangle's material (m,)."""
    materials: tuple[Material | None, ...] = (None,)
    """Materials by their numbers; None where the file has none."""
    missing: tuple[Lost, ...] = ()
    """Materials and pictures that the file names and that cannot be read."""

    def parts(self) -> list[tuple[Self, Material | None]]:
        """Split this surface by materials: return a pair for each material, the surface of its
        triangles and the material (None for triangles without one).
        """
        found: list[tuple[Self, Material | None]] = []
        for look in np.unique(self.looks):
            own = self.looks == look
            used, faces = np.unique(self.faces[own], return_inverse=True)
            places = None if self.places is None else self.places[own]
            part = type(self)(self.vertices[used], faces.reshape(-1, 3), places)
            found.append((part, self.materials[look]))
        return found


@dataclass(frozen=True, slots=True)
class _Beside:
    """The files that a mesh names, at their paths or else beside the mesh."""

    folder: Path
    libraries: list[str]
    """Files of materials that an OBJ file names."""
    missing: list[Lost] = field(default_factory=list)

    def get(self, name: str) -> bytes:
        """Return the content of a file. A file that cannot be read is added to `missing`.

        Raises:
            FileNotFoundError: There is no such file, or it cannot be read.
        """
        plain = name.replace("\\", "/")
        bare = PureWindowsPath(name).name
        # The last ones are without options, such as "-s 1 1 1 wood.png".
        names = (plain, bare, *plain.split()[-1:], *bare.split()[-1:])
        files = [self.folder / each for each in names]
        file = next((f for f in files if f.is_file()), files[1])
        try:
            if file.suffix.lower() != ".mtl":
                read_image(file)
            return file.read_bytes()
        except (OSError, ValueError) as error:
            self.missing.append((file.name, why_not(file)))
            raise FileNotFoundError from error

    def __getitem__(self, name: str) -> bytes:
        """Return the contents of all files of materials that the OBJ file names, joined by line
        breaks, whichever of them is asked for, because trimesh asks for the first only. If the mesh
        names none, return the content of the file `name`.

        Raises:
            FileNotFoundError: There is no such file, or it cannot be read.
        """
        found: list[bytes] = []
        for each in self.libraries or [name]:
            with contextlib.suppress(FileNotFoundError):
                found.append(self.get(each))
        if not found:
            raise FileNotFoundError(name)
        return b"\n".join(found)


def trimesh() -> ModuleType:
    """Import the package trimesh and return it. The import takes half a second, so it is done only
    when the package is needed.
    """
    return importlib.import_module("trimesh")


def listed(lost: Iterable[Lost]) -> str:
    """Return a text with the names of files and shapes that were left out, grouped by reason, such
    as "a.stl, b.stl (no such file)", at most four names for each reason. `lost` has pairs of a name
    and a reason.
    """
    names = defaultdict[str, list[str]](list)
    for name, why in lost:
        names[why].append(name)
    return ", ".join(f"{first_of(each)} ({why})" for why, each in names.items())


def first_of(names: Iterable[str]) -> str:
    """Return the first four different names as a text, followed by the number of further ones, such
    as "a, b, c, d and 3 more".
    """
    each = list(dict.fromkeys(names))
    more = f" and {len(each) - SHOWN} more" if len(each) > SHOWN else ""
    return ", ".join(each[:SHOWN]) + more


def is_readable(file: Path) -> bool:
    """Return whether trimesh can read a mesh file, judged by the suffix of its name; Collada (.dae)
    needs the package pycollada.
    """
    return file.suffix.lower()[1:] in trimesh().available_formats()


def why_not(file: Path) -> str:
    """Return why a mesh or picture file could not be read: "no such file", "pip install pycollada"
    (for Collada) or "it cannot be read".
    """
    if not file.is_file():
        return "no such file"
    needs = file.suffix.lower() == COLLADA and not is_readable(file)
    return "pip install pycollada" if needs else "it cannot be read"


def read_mesh(
    path: Path, suffixes: tuple[str, ...] = SUFFIXES, *, materials: bool = True
) -> Triangles:
    """Return the surface in a mesh file, with its materials; materials and pictures that cannot be
    read are listed in its field `missing`.

    Args:
        path: The file.
        suffixes: Suffixes of the accepted files, such as ".stl".
        materials: Read materials too, for an OBJ file from the .mtl files that it names.

    Raises:
        ValueError: The file has another suffix, cannot be read, is damaged, has no triangle with
            three different corners, or has a vertex that is not finite.
    """
    suffix = path.suffix.lower()
    if suffix not in suffixes:
        raise ValueError(f"{path}: this is not a mesh of a target: give an .obj or .stl file")
    with reading.opened(path, "mesh") as file:
        content = file.read()
    used = None
    libraries: list[str] = []
    if suffix == OBJ:
        content = content.replace(b"\t", b" ")  # trimesh knows blanks only after usemtl
        used = set(_names(USED, content))
        libraries = _names(LIBRARY, content)
    files = _Beside(path.parent, libraries)
    try:
        scene = trimesh().load_scene(
            BytesIO(content),
            suffix[1:],
            process=False,
            resolver=files,
            skip_materials=not materials,
        )
        points, corners, places, looks, found = _joined(scene, used, files.missing)
        if used is not None and materials and not files.missing:
            files.missing.extend(_unknown(used, scene))
        vertices, same = np.unique(points, axis=0, return_inverse=True)
        faces = same.reshape(-1)[corners]
        if suffix == ".stl" and not len(faces):
            content.decode("ascii")  # where it is no text, trimesh may take it for one
    except Exception:  # trimesh's readers raise what they meet in a broken file
        raise ValueError(
            f"{path}: this mesh is damaged, or not of the format that its suffix says: "
            "export it again"
        ) from None
    broken = ~np.isfinite(vertices).all(axis=1)
    if broken.any():
        vertex = " ".join(f"{number:g}" for number in vertices[broken][0])
        raise ValueError(f"{path}: the vertex {vertex} is not finite: correct it")
    # Corners that fell together leave triangles without an area, which MuJoCo refuses.
    whole = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    if not whole.any():
        raise ValueError(
            f"{path}: there is no triangle with an area in this mesh: give another file"
        )
    return Triangles(
        vertices,
        faces[whole],
        None if places is None else places[whole],
        looks[whole],
        found,
        tuple(files.missing),
    )


def _unknown(used: set[str], scene: Any) -> list[Lost]:
    """Return the materials that an OBJ file uses and no .mtl file describes."""
    parts = scene.geometry.values()
    known = {getattr(getattr(p.visual, "material", None), "name", None) for p in parts}
    return [(name, "no .mtl file describes it") for name in sorted(used - known)]


def _names(pattern: re.Pattern[bytes], obj: bytes) -> list[str]:
    return [name.decode("utf-8", "replace") for name in pattern.findall(obj)]


def _joined(
    scene: Any, used: set[str] | None, missing: list[Lost]
) -> tuple[Array, Indices, Array | None, Indices, tuple[Material | None, ...]]:
    """Return the corners of all parts of a scene (n, 3), its triangles (m, 3), their texture
    coordinates (m, 3, 2), the number of each triangle's material (m,), and the materials.

    Args:
        scene: Scene that trimesh has read.
        used: The names of the materials that an OBJ file uses; None for another kind of file.
        missing: List to which pictures without texture coordinates are added.
    """
    points: list[Array] = [np.zeros((0, 3))]
    faces: list[Indices] = [np.zeros((0, 3), np.int64)]
    places: list[Array] = [np.zeros((0, 3, 2))]
    looks: list[Indices] = [np.zeros(0, np.int64)]
    materials: list[Material | None] = []
    scale = trimesh().units.unit_conversion(scene.units, "meters") if scene.units else 1.0
    for node in scene.graph.nodes_geometry:
        pose, name = scene.graph[node]
        part = scene.geometry[name]
        uv: Array | None = getattr(part.visual, "uv", None)
        material = _material(part.visual, used)
        if material is not None and material.picture is not None and uv is None:
            missing.append((f"the picture of {part.visual.material.name}", "the mesh has no vt"))
            material = Material(material.colour)
        corners = np.asarray(part.faces)
        placed = np.full((len(corners), 3, 2), np.nan) if uv is None else np.asarray(uv)[corners]
        places.append(placed)
        faces.append(corners + sum(map(len, points)))
        points.append(scale * trimesh().transform_points(part.vertices, pose))
        looks.append(np.full(len(corners), len(materials)))
        materials.append(material)
    every = np.concatenate(places)
    return (
        np.concatenate(points),
        np.concatenate(faces),
        None if np.isnan(every).all() else every,
        np.concatenate(looks),
        tuple(materials),
    )


def _material(visual: Any, used: set[str] | None) -> Material | None:
    """Return the material of a part of a mesh, its colour or picture; None if it has none."""
    if visual.kind is None:
        return None
    if visual.kind != "texture":
        return Material(tuple((np.asarray(visual.main_color) / 255).tolist()))
    material = visual.material
    if used is not None and material.name not in used:
        return None  # it has places in a picture; trimesh makes up a grey material
    picture = getattr(material, "image", None)
    return Material(
        tuple((np.asarray(material.main_color) / 255).tolist()),
        None if picture is None else np.asarray(picture.convert("RGB")),
    )
