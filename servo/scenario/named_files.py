"""Files that a scenario or a study names: where they lie, and a digest of what is in them."""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

FILES = ("model", "file", "picture", "texture", "calibration")
"""Settings that name a file, or several."""
MODELS = (".xml", ".urdf")
"""Files that name others: meshes, pictures, included models."""
MISSING = "missing"
DIGITS = 12


def found_beside(table: dict[str, Any], folder: Path) -> dict[str, Any]:
    """The table of a file in a folder, in which files that lie in this folder have their whole
    path; others stay as they are, and count from the working directory.
    """

    def whole(name: str) -> str:
        try:
            path = (folder / name).resolve()
            return str(path) if path.is_file() else name
        except (OSError, RuntimeError, ValueError):  # no file can have this name
            return name

    return _changed(table, whole)


def digests(*tables: Any) -> dict[str, str]:
    """A digest of each file that tables name, and of all that a model consists of, by path.

    Shipped files, which are named without a path, belong to our source and are left out.
    """
    found: dict[str, str] = {}

    def note(name: str) -> str:
        if (digest := digest_of(name)) != MISSING:
            found[name] = digest
        return name

    for table in tables:
        _changed(table, note)
    return found


def digest_of(name: str) -> str:
    """The digest of a file, with those that a model names; "missing" where there is none."""
    path = Path(name)
    try:
        files = sorted(_parts(path)) if path.suffix.lower() in MODELS else [path]
        each = [_digest(f, f.stat().st_mtime_ns, f.stat().st_size) for f in files if f.is_file()]
    except (OSError, ValueError):
        return MISSING
    return hashlib.sha256(" ".join(each).encode()).hexdigest()[:DIGITS] if each else MISSING


def _parts(model: Path) -> set[Path]:
    from sim.models.model_files import files_of  # only now: it imports MuJoCo

    return files_of(model)


@functools.lru_cache(maxsize=1024)
def _digest(path: Path, changed: int, size: int) -> str:
    """Of a file that has this size and was changed then [ns]."""
    del changed, size
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _changed(value: Any, change: Callable[[str], str], *, is_file: bool = False) -> Any:
    """A table in which all names of files are changed."""
    match value:
        case dict():
            return {
                key: _changed(item, change, is_file=is_file or key.rpartition(".")[2] in FILES)
                for key, item in value.items()
            }
        case list():
            return [_changed(item, change, is_file=is_file) for item in value]
        case str() if is_file:
            return change(value)
        case _:
            return value
