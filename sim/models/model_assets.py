"""Meshes and pictures of a model: found in the model's own folder, and measured before they are
loaded.
"""

import re
import stat
import struct
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

MOST_BYTES = 100_000_000
MOST_FACES = 1_000_000
MOST_PIXELS = 50_000_000
"""Limits of a whole model: its files, its meshes, its pictures."""
MESHES = (".stl", ".obj", ".msh")
PNG = b"\x89PNG\r\n\x1a\n"
PNG_SIZE = slice(16, 24)
"""Where a PNG has its width and height, after the signature and the head of its first block."""
STL_HEAD = 84
STL_FACES = slice(80, 84)
STL_FACE = 50
"""Binary STL [bytes]: its head, the number of faces in it, and the size of a face."""
MSH_FACES = slice(12, 16)
PACKAGE = re.compile("^(package|model)://([^/]*)/+")
"""How URDF names a file of a ROS package."""


@dataclass(slots=True)
class Assets:
    """The files of one model, counted as they are found."""

    root: Path
    """The folder that none of them may leave, resolved."""
    bytes: int = 0
    faces: int = 0
    pixels: int = 0
    seen: set[Path] = field(default_factory=set[Path])

    def start(self, model: Path) -> Path:
        """Count the model's own file, which the user chose: it may be a link to anywhere.

        Raises:
            ValueError: It is too large.
        """
        path = model.resolve()
        self._count(path, path.stat().st_size)
        return path

    def find(self, name: str, *folders: Path) -> Path:
        """The resolved path of a file, which is added to the size of the model.

        Args:
            name: As the model has it.
            folders: Where it may be, by order; each inside the root.

        Raises:
            ValueError: It is outside the root, missing, no regular file, or too large.
        """
        for folder in folders:
            path = self._inside(name, folder)
            try:
                status = path.stat()
            except (FileNotFoundError, NotADirectoryError):
                continue
            except OSError as error:
                raise ValueError(f"cannot read its file '{name}': {error.strerror}") from None
            if not stat.S_ISREG(status.st_mode):
                raise ValueError(f"its file '{name}' is not a regular file")
            self._count(path, status.st_size)
            return path
        raise ValueError(f"its file '{name}' is missing in {folders[0]}")

    def add_mesh(self, path: Path) -> None:
        """Count the faces of a mesh.

        Raises:
            ValueError: It is no mesh that can be read, or the model has too many faces.
        """
        if path.suffix.lower() not in MESHES:
            raise ValueError(f"its mesh '{path.name}' is not one of {', '.join(MESHES)}")
        self.faces += _faces(path)
        if self.faces > MOST_FACES:
            raise ValueError(
                f"with '{path.name}' its meshes have {self.faces:,} faces; the limit is "
                f"{MOST_FACES:,}"
            )

    def add_picture(self, path: Path) -> None:
        """Count the pixels of a picture.

        Raises:
            ValueError: It is no PNG, or as for `add_pixels`.
        """
        with _opened(path) as file:
            head = file.read(PNG_SIZE.stop)
        if len(head) < PNG_SIZE.stop or not head.startswith(PNG):
            raise ValueError(f"its picture '{path.name}' is no PNG")
        width, height = struct.unpack(">II", head[PNG_SIZE])
        self.add_pixels(width * height, path.name)

    def add_pixels(self, pixels: int, name: str) -> None:
        """Count the pixels of a picture that has a name.

        Raises:
            ValueError: The model has too many.
        """
        self.pixels += pixels
        if self.pixels > MOST_PIXELS:
            raise ValueError(
                f"with '{name}' its pictures have {self.pixels:,} pixels; the limit is "
                f"{MOST_PIXELS:,}"
            )

    def _inside(self, name: str, folder: Path) -> Path:
        try:
            path = (folder / name).resolve()
        except (OSError, RuntimeError, ValueError):
            raise ValueError(f"no file can have the name '{name}'") from None
        if not path.is_relative_to(self.root):
            raise ValueError(
                f"its file '{name}' is outside the model's own folder {self.root}; copy it there"
            )
        return path

    def _count(self, path: Path, size: int) -> None:
        if path not in self.seen:
            self.seen.add(path)
            self.bytes += size
        if self.bytes > MOST_BYTES:
            raise ValueError(
                f"with '{path.name}' its files have {self.bytes:,} bytes; the limit is "
                f"{MOST_BYTES:,}"
            )


def package_root(model: Path) -> Path:
    """The ROS package that a URDF is part of: the nearest folder above with a package.xml; else the
    folder that it lies in.
    """
    own = model.parent.resolve()
    return next((f for f in (own, *own.parents) if (f / "package.xml").is_file()), own)


def _opened(path: Path) -> BinaryIO:
    try:
        return path.open("rb")
    except OSError as error:
        raise ValueError(f"cannot read its file '{path.name}': {error.strerror}") from None


def _faces(path: Path) -> int:
    """How many triangles a mesh says that it has, without loading it."""
    with _opened(path) as file:
        if path.suffix.lower() == ".obj":
            corners = (len(line.split()) - 1 for line in file if line[:2] in (b"f ", b"f\t"))
            return sum(max(0, n - 2) for n in corners)
        head = file.read(STL_HEAD)
    is_stl = path.suffix.lower() == ".stl"
    place = STL_FACES if is_stl else MSH_FACES
    faces = struct.unpack("<I", head[place])[0] if len(head) >= place.stop else 0
    if is_stl and path.stat().st_size != STL_HEAD + STL_FACE * faces:
        raise ValueError(f"its mesh '{path.name}' is no binary STL, or is cut off")
    return faces
