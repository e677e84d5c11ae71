"""Search for the folders of ROS packages, by name, around a model that refers to files in them."""

import os
import re
from collections.abc import Iterator
from itertools import chain, islice
from pathlib import Path
from urllib.parse import unquote
from xml.etree import ElementTree

FILE = re.compile("^file:(//)?", re.IGNORECASE)
IN_PACKAGE = re.compile(r"^(?:(?:package|model)://+|\$\(find\s+)([^/)]+)\)?/+(.*)", re.IGNORECASE)
"""Name of a file in a ROS package, as URDF has it."""
AROUND = 4
"""Number of folders above a model whose subfolders are searched: urdf, its package, a repository,
src."""
MOST = 1000
"""Most subfolders that are searched in each of the `AROUND` folders: a model may lie in a home
folder."""


def parted(name: str) -> tuple[str, str]:
    """Split a file name such as "package://arm/link.stl" into the name of its ROS package and the
    path inside the package; the package is "" for a plain path. A leading "file://" is removed,
    percent codes such as "%20" are decoded, and backslashes become slashes.
    """
    plain = FILE.sub("", unquote(name).replace("\\", "/"))
    found = IN_PACKAGE.match(plain)
    return (found[1], found[2]) if found else ("", plain)


def is_file(path: Path) -> bool:
    """Return whether a path is an existing file, or a link to one; False for a path that no file
    can have.
    """
    return os.path.isfile(path)  # noqa: PTH113 (Path's raises for such a name)


def folders_above(model: Path) -> list[Path]:
    """Return the folders above a file, the nearest first; if the path has links, followed by the
    folders above the file to which it leads.
    """
    return list(dict.fromkeys((*model.absolute().parents, *model.resolve().parents)))


def package_folder(model: Path, package: str, inside: str) -> Path | None:
    """Return the folder of the ROS package called `package` that contains the file `inside` (a
    relative path), near a model file; None if there is none.

    Searched are the folders above the model, the places in each of them where the package may lie
    or be installed, and the folders up to two levels below the nearest four of them (at most 1000
    in each, and no hidden ones). The result is the first whose package.xml gives the name
    `package`, or that is itself called so and has no package.xml with a name. If there is none, it
    is a folder above the model, or directly in one, that is called so though its package.xml gives
    another name.
    """
    having = (folder for folder in _around(model, package) if is_file(folder / inside))
    own = next((folder for folder in having if _name_of(folder) == package), None)
    # Else one of this name whose package.xml has another.
    named = (f for above in folders_above(model) for f in (above, above / package))
    return own or next((f for f in named if f.name == package and is_file(f / inside)), None)


def _around(model: Path, package: str) -> Iterator[Path]:
    """Yield the folders around a model file that may be the ROS package of this name, the most
    likely first.
    """
    installed = Path(package, "share", package)
    for folder in folders_above(model):
        yield from (folder, folder / package, folder / installed, folder / "install" / installed)
    for folder in (*model.absolute().parents[:AROUND], *model.resolve().parents[:AROUND]):
        yield from islice(chain(sorted(folder.glob("[!.]*/")), folder.glob("[!.]*/[!.]*/")), MOST)


def _name_of(folder: Path) -> str:
    """Return the name of the package in a folder, by its package.xml; else the folder's name."""
    try:
        found = ElementTree.parse(folder / "package.xml").findtext("name", "").strip()
    except (OSError, ElementTree.ParseError, ValueError, LookupError):
        found = ""
    return found or folder.name
