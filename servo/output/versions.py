"""The versions that decide the numbers: of the packages, and of our own source."""

from __future__ import annotations

import functools
import hashlib
from importlib import metadata, resources
from pathlib import Path

from sim.installed import packages

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
"""What our source is; the scenarios are kept with each result anyway."""
PICTURES = "pictures"
"""Of the README: they decide nothing."""
SOURCE = "servobench source"
DIGITS = 12


def versions() -> dict[str, str]:
    """Version by package, and the digest of our own source, which changes with any edit.

    Packages that bring kinds by entry points are named too.
    """
    found = {name: metadata.version(name) for name in VERSIONED}
    return {VERSIONED[0]: found.pop(VERSIONED[0]), SOURCE: source_digest(), **found, **packages()}


@functools.cache
def source_digest() -> str:
    """A short digest of the installed source and models, as they are when it is first asked for."""
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
