"""Versions of the packages on which the results of a run depend, and a digest of our own source."""

import functools
import hashlib
import os
from importlib import metadata, resources

from sim.camera import gl
from sim.installed import packages

OPENCV = (
    "opencv-python-headless",
    "opencv-python",
    "opencv-contrib-python-headless",
    "opencv-contrib-python",
)
"""Distributions of `cv2`: all write into one folder, so that only one can be intact."""
VERSIONED = (
    "servobench",
    "mujoco",
    "numpy",
    "scipy",
    "numba",
    *OPENCV,
    "filterpy",
    "daqp",
    "mink",
    "av",
    "trimesh",
)
PACKAGES = ("servo", "tracking", "sim", "scenes")
ENDINGS = (".py", ".xml", ".png", ".obj")
"""Packages and files that the digest includes; scenarios are stored with each result."""
PICTURES = "pictures"
"""Folder with the README's pictures, which the digest leaves out."""
SOURCE = "servobench source"
RENDERING = "pictures"
"""Entries that are no packages: the digest of the source, and how pictures are rendered."""
DIGITS = 12


def versions() -> dict[str, str]:
    """Return the versions, by name, of all packages on which the results of a run depend.

    Further entries are a digest of servobench's source ("servobench source"), how pictures are
    rendered ("pictures": whether OpenGL is hidden), and packages that add kinds of components by
    entry points.
    """
    pictures = "exact, without OpenGL" if gl.WITHOUT in os.environ else "as set"
    return {**_own(), RENDERING: pictures, **packages()}


@functools.cache  # reading them takes 17 ms, as much as a short run
def _own() -> dict[str, str]:
    there = [name for name in VERSIONED if name not in OPENCV or is_installed(name)]
    found = {name: metadata.version(name) for name in there}
    return {VERSIONED[0]: found.pop(VERSIONED[0]), SOURCE: source_digest(), **found}


def is_installed(name: str) -> bool:
    """Return whether a Python distribution of this name is installed."""
    try:
        metadata.version(name)
    except metadata.PackageNotFoundError:
        return False
    return True


def clash() -> str:
    """Return a sentence that asks the user to uninstall all distributions of OpenCV and install one
    of them, if more than one is installed; else "".
    """
    there = [name for name in OPENCV if is_installed(name)]
    if len(there) < 2:
        return ""
    return (
        f"{' and '.join(there)} write into the same folder cv2: uninstall all, then install one; "
        "the contrib ones hold all that the others do"
    )


@functools.cache
def source_digest() -> str:
    """Return a digest, 12 hexadecimal digits, of the installed source code, models and textures of
    servobench; it is computed at the first call.
    """
    whole = hashlib.sha256()
    for package in PACKAGES:
        with resources.as_file(resources.files(package)) as root:
            for path in sorted(p for p in root.rglob("*") if p.suffix in ENDINGS):
                if path.parent.name == PICTURES:
                    continue
                content = path.read_bytes()
                whole.update(f"{package}/{path.relative_to(root)} {len(content)}\n".encode())
                whole.update(content)
    return whole.hexdigest()[:DIGITS]
