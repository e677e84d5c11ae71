"""Versions of the packages that decide the numbers, and a digest of our own source."""

from __future__ import annotations

import functools
import hashlib
from importlib import metadata, resources
from pathlib import Path

VERSIONED = (
    "servobench",
    "mujoco",
    "numpy",
    "numba",
    "opencv-python-headless",
    "filterpy",
    "rerun-sdk",
)
PACKAGES, ENDINGS = ("servo", "tracking", "sim", "scenes"), (".py", ".xml", ".png")
"""Packages and files that the digest includes; scenarios are stored with each result."""
PICTURES = "pictures"
"""Folder with the README's pictures, which the digest leaves out."""
SOURCE = "servobench source"
DIGITS = 12


def versions() -> dict[str, str]:
    """Versions by package, and the digest of our own source, which any edit changes."""
    found = {name: metadata.version(name) for name in VERSIONED}
    return {VERSIONED[0]: found.pop(VERSIONED[0]), SOURCE: source_digest(), **found}


@functools.cache
def source_digest() -> str:
    """A short digest of the installed source and models at the first call."""
    whole = hashlib.sha256()
    for package in PACKAGES:
        with resources.as_file(resources.files(package)) as root:
            for path in sorted(p for p in root.rglob("*") if _counts(p)):
                content = path.read_bytes()
                whole.update(f"{package}/{path.relative_to(root)} {len(content)}\n".encode())
                whole.update(content)
    return whole.hexdigest()[:DIGITS]


def _counts(path: Path) -> bool:
    return path.suffix in ENDINGS and path.parent.name != PICTURES
