"""The file of a scenario, by its shipped name or by its path, as a TOML table."""

from __future__ import annotations

from importlib import resources
from pathlib import Path
from typing import Any

from servo.mistake import Mistake, unknown
from servo.scenario import toml
from servo.scenario.catalogue import shipped
from servo.scenario.named_files import found_beside

Table = dict[str, Any]


def read(name: str) -> tuple[Table, str]:
    """Return the TOML table of a scenario, not checked yet, and its file's name for messages.

    Files that it names are looked for beside it first, then from the working directory.

    Raises:
        Mistake: There is no such file, or it is no TOML.
    """
    path = path_of(name)
    table = toml.decode(toml.read(path, "scenario"), path.name)
    return (table if name in shipped() else found_beside(table, path.parent)), path.name


def path_of(name: str) -> Path:
    """Return the file of a scenario, by its shipped name or by its path.

    Raises:
        Mistake: There is no such name.
    """
    path = Path(name)
    if path.suffix == ".toml":
        return path
    if name not in shipped():
        raise Mistake(f"{unknown(name, shipped(), 'scenario')} (or give a .toml file)")
    return Path(str(resources.files("scenes") / f"{name}.toml"))
