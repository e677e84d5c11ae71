"""Folders of ROS packages, found by their names around a model that names files in them."""

import os
import re
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from urllib.parse import unquote
from xml.etree import ElementTree

FILE = re.compile("^file:(//)?", re.IGNORECASE)
IN_PACKAGE = re.compile(r"^(?:(?:package|model)://+|\$\(find\s+)([^/)]+)\)?/+(.*)", re.IGNORECASE)
"""How URDF begins the name of a file, other than with its path."""
AROUND = 4
"""Folders above a model whose content is looked through: urdf, its package, a repository, src."""
MOST = 1000
"""Folders that are looked through in each: a model may be in a home folder."""


def parted(name: str) -> tuple[str, str]:
    """Return the ROS package in the name of a file, empty where there is none, and the path."""
    plain = FILE.sub("", unquote(name).replace("\\", "/"))
    found = IN_PACKAGE.match(plain)
    return (found[1], found[2]) if found else ("", plain)


def is_file(path: Path) -> bool:
    """Return whether there is a file; never of a name that no file can have."""
    return os.path.isfile(path)  # noqa: PTH113 (Path's raises for such a name)


def folders_above(model: Path) -> list[Path]:
    """Return the folders above a file, the nearest first; then those above what it links to."""
    return list(dict.fromkeys((*model.absolute().parents, *model.resolve().parents)))


def package_folder(model: Path, package: str, inside: str) -> Path | None:
    """Return the folder of a ROS package that has a file of a given path; None without one."""
    return next((f for f in _folders(model, package) if is_file(f / inside)), None)


def _folders(model: Path, package: str) -> Iterator[Path]:
    """Yield folders that may be a package, the most likely first."""
    above = folders_above(model)
    installed = Path(package, "share", package)
    for folder in above:
        near = (folder, folder / package, folder / installed, folder / "install" / installed)
        yield from (f for f in near if _name_of(f) == package)
    for folder in (*model.absolute().parents[:AROUND], *model.resolve().parents[:AROUND]):
        yield from (f for f in islice(_below(folder), MOST) if _name_of(f) == package)
    yield from (folder / package for folder in above)  # its package.xml has another name
    yield from (folder for folder in above if folder.name == package)


def _name_of(folder: Path) -> str:
    """The name of a package in a folder: that of its package.xml, else the folder's."""
    try:
        found = ElementTree.parse(folder / "package.xml").findtext("name", "").strip()
    except (OSError, ElementTree.ParseError, ValueError, LookupError):
        found = ""
    return found or folder.name


def _below(folder: Path) -> Iterator[Path]:
    """Yield the folders in a folder, and then those in them."""
    children = _in(folder)
    yield from children
    for child in children:
        yield from _in(child)


def _in(folder: Path) -> list[Path]:
    try:
        found = sorted(path for path in folder.iterdir() if path.is_dir())
    except OSError:
        return []
    return [path for path in found if not path.name.startswith(".")]
