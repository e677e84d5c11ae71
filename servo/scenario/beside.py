"""Files that a scenario names: a path is looked for in the scenario's folder first."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from servo.scenario.catalogue import PLUGINS

FILES = ("model", "file", "picture", "texture")
"""Settings that name a file."""


def found_beside(table: dict[str, Any], folder: Path) -> dict[str, Any]:
    """A scenario's table in which files that lie in its folder have their whole path; others stay
    as they are, and count from the working directory.
    """
    changed = dict(table)
    for part in PLUGINS:
        settings = table.get(part)
        if isinstance(settings, dict):
            changed[part] = {key: _found(key, value, folder) for key, value in settings.items()}
    return changed


def _found(key: str, value: Any, folder: Path) -> Any:
    if key not in FILES or not isinstance(value, str):
        return value
    try:
        path = (folder / value).resolve()
        return str(path) if path.is_file() else value
    except (OSError, ValueError):  # no file can have this name
        return value
