"""Triangle meshes from OBJ and STL files: vertices, faces, and where a picture lies on them."""

import re
import struct
from dataclasses import dataclass
from io import BytesIO, TextIOWrapper
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sim.files import reading
from sim.types import Array

Indices = NDArray[np.int64]
LARGEST = 100_000_000
"""Largest file of a mesh [bytes]."""
MOST_FACES = 1_000_000
LONGEST_LINE = 1_000_000
FARTHEST = 1e9
"""Beyond this a coordinate means nothing, whatever its unit."""
STL_HEAD = 84
STL_FACE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")])
VERTEX = re.compile(rb"^\s*vertex\b(.*)$", re.MULTILINE)
Corner = tuple[int, int]
"""Indices from 0 of a vertex and of a place in a picture; -1 where there is none."""


@dataclass(frozen=True, slots=True)
class Triangles:
    """A surface of triangles. No two vertices are the same; no triangle has two equal corners."""

    vertices: Array
    """Points (n, 3), in the file's unit."""
    faces: Indices
    """Three vertices of each triangle (m, 3), counter-clockwise as seen from outside."""
    places: Array | None = None
    """Where the corners of the triangles lie in a picture (m, 3, 2): 0..1 from its left and from
    its bottom; None where the file does not say."""


def read_mesh(path: Path) -> Triangles:
    """The surface in an OBJ or STL file.

    Raises:
        ValueError: It cannot be read, is too large, or is broken.
    """
    suffix = path.suffix.lower()
    if suffix not in (".obj", ".stl"):
        raise ValueError(f"{path}: a mesh is an .obj or an .stl file")
    data = reading.content(path, "mesh", LARGEST)
    try:
        mesh = _cleaned(_obj(data) if suffix == ".obj" else _stl(data))
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    return mesh


def _cleaned(mesh: Triangles) -> Triangles:
    """Equal vertices as one, and without triangles that have two of them."""
    _check_count(len(mesh.faces))
    if not (np.abs(mesh.vertices) < FARTHEST).all():
        raise ValueError(f"a vertex is not finite, or farther away than {FARTHEST:g}")
    vertices, same = np.unique(mesh.vertices, axis=0, return_inverse=True)
    faces = same.reshape(-1)[mesh.faces]
    whole = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    if not whole.any():
        raise ValueError("there is no triangle in this mesh")
    places = None if mesh.places is None else mesh.places[whole]
    return Triangles(vertices, faces[whole], places)


def _check_count(faces: int) -> None:
    if faces > MOST_FACES:
        raise ValueError(f"this mesh has {faces:,} faces; the limit is {MOST_FACES:,}")


def _obj(data: bytes) -> Triangles:
    """Polygons become fans of triangles."""
    points: list[list[float]] = []
    texture: list[list[float]] = []
    corners: list[tuple[Corner, Corner, Corner]] = []
    for number, line in enumerate(TextIOWrapper(BytesIO(data), "utf-8", "replace"), start=1):
        if len(line) > LONGEST_LINE:
            raise ValueError(f"line {number} is longer than {LONGEST_LINE:,} characters")
        match line.split():
            case ["v", x, y, z, *_]:
                points.append([_number(word, number) for word in (x, y, z)])
            case ["vt", u, v, *_]:
                texture.append([_number(word, number) for word in (u, v)])
            case ["f", first, second, third, *more]:
                words = (first, second, third, *more)
                _check_count(len(corners) + len(words) - 2)
                around = [_corner(word, len(points), len(texture), number) for word in words]
                corners += [(around[0], b, c) for b, c in pairwise(around[1:])]
            case ["v" | "vt" | "f", *_]:
                raise ValueError(f"line {number} is too short")
            case _:  # a comment, a normal, a name, a material
                pass
        if max(len(points), len(texture)) > 3 * MOST_FACES:
            raise ValueError(f"this mesh has too many vertices; the limit is {3 * MOST_FACES:,}")
    indices = np.array(corners, np.int64).reshape(-1, 3, 2)
    known = texture and (indices[:, :, 1] >= 0).all()
    places = np.array(texture)[indices[:, :, 1]] if known else None
    return Triangles(np.array(points).reshape(-1, 3), indices[:, :, 0], places)


def _number(word: str, line: int) -> float:
    try:
        return float(word)
    except ValueError:
        raise ValueError(f"line {line}: {word!r} is not a number") from None


def _corner(word: str, points: int, places: int, line: int) -> Corner:
    """A face's corner, such as "7", "7/3", "7/3/1", "7//1", "-1"."""
    vertex, _, rest = word.partition("/")
    place = rest.partition("/")[0]
    index = _index(vertex, points, "vertex", line)
    return index, _index(place, places, "place in a picture", line) if place else -1


def _index(word: str, count: int, what: str, line: int) -> int:
    try:
        given = int(word)
    except ValueError:
        raise ValueError(f"line {line}: {word!r} is not the number of a {what}") from None
    index = given - 1 if given > 0 else given + count
    if given == 0 or not 0 <= index < count:
        raise ValueError(f"line {line}: there is no {what} {given}; there are {count} before it")
    return index


def _stl(data: bytes) -> Triangles:
    """Binary where the size is that of its triangles, else text."""
    count = struct.unpack_from("<I", data, STL_HEAD - 4)[0] if len(data) >= STL_HEAD else 0
    expected = STL_HEAD + count * STL_FACE.itemsize
    if len(data) >= STL_HEAD and len(data) == expected:
        _check_count(count)
        corners = np.frombuffer(data, STL_FACE, count, STL_HEAD)["corners"].reshape(-1, 3)
    elif data.lstrip()[:5].lower() == b"solid":
        corners = _stl_text(data)
    else:
        raise ValueError(
            f"this STL file is cut off or damaged: it has {len(data):,} bytes, not {expected:,}"
        )
    return Triangles(corners.astype(float), np.arange(len(corners)).reshape(-1, 3))


def _stl_text(data: bytes) -> Array:
    """Corners (3 n, 3) in the order of the text."""
    found: list[bytes] = VERTEX.findall(data.lower())
    _check_count(len(found) // 3)
    try:
        return np.array([line.split() for line in found], float).reshape(-1, 3, 3).reshape(-1, 3)
    except ValueError:
        raise ValueError("this STL file is cut off or damaged") from None
