"""Files that a scenario, a study or a part names: where they lie, and a digest of what is in them.

A setting names a file where its type is `sim.ranges.File`.
"""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import fields
from pathlib import Path
from typing import Any, get_args, get_type_hints

from servo.scenario.tables import config_of
from sim.installed import Trusted
from sim.ranges import NamesFile

Table = dict[str, Any]
Change = Callable[[str], str]
MODELS = (".xml", ".urdf")
"""Files that name others: meshes, pictures, included models."""
MISSING = "missing"
DIGITS = 12
"""Digits of a digest: 48 bits do not collide by chance among the files of a study."""
AROUND = {"vary": 1, "set": 1, "axes": 1, "named": 3}
"""Tables of dotted settings, and how many keys lead to the settings in them."""


@functools.cache
def file_settings(config: type[Any]) -> frozenset[str]:
    """Return the settings of a dataclass that name a file, or several."""
    hints = get_type_hints(config, include_extras=True)
    return frozenset(field.name for field in fields(config) if _names_file(hints[field.name]))


def _names_file(hint: Any) -> bool:
    """Return whether a type is `File`, or has it inside, as in `File | None`."""
    marks = getattr(hint, "__metadata__", ())
    return any(isinstance(m, NamesFile) for m in marks) or any(map(_names_file, get_args(hint)))


def found_beside(table: Table, folder: Path, *bases: Table) -> Table:
    """Return the table of a scenario or a study in a folder, with the whole path of each file that
    lies in this folder; other names count from the working directory.

    Args:
        table: As its file has it; what the command line has set in it stays as it is.
        folder: Where that file lies.
        *bases: The scenarios of a study, whose kinds its settings belong to.
    """

    def whole(name: str) -> str:
        if isinstance(name, Trusted):
            return name
        try:
            path = (folder / name).resolve()
            return str(path) if path.is_file() else name
        except (OSError, RuntimeError, ValueError):  # no file can have this name
            return name

    return _changed(table, _are_files(table, *bases), whole)


def named_in(*tables: Table) -> list[str]:
    """Return the files that the tables of a study and its scenarios name."""
    found: list[str] = []

    def note(name: str) -> str:
        found.append(name)
        return name

    are_files = _are_files(*tables)
    for table in tables:
        _changed(table, are_files, note)
    return found


def named_by(config: Any) -> list[str]:
    """Return the files that the settings of a part name."""
    values = [getattr(config, name) for name in sorted(file_settings(type(config)))]
    each = (value if isinstance(value, tuple) else [value] for value in values)
    return [name for names in each for name in names if isinstance(name, str)]


def digests(names: Iterable[str]) -> dict[str, str]:
    """Return a digest of each file, and of all that a model consists of, by its name.

    Shipped files, which are named without a path, belong to our source and are left out.
    """
    found = {name: digest_of(name) for name in names}
    return {name: digest for name, digest in found.items() if digest != MISSING}


def digest_of(name: str) -> str:
    """Return the digest of a file, with those that a model names; MISSING where there is none."""
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
    """Return the digest of a file that has this size and was changed then [ns]."""
    del changed, size
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _are_files(*tables: Table) -> Callable[[tuple[str, ...]], bool]:
    """Return whether a setting names a file, by its section and its name."""
    kinds: dict[str, set[str]] = {}
    for table in tables:
        for (section, *rest), value in _settings(table):
            if rest == ["kind"] and isinstance(value, str):
                kinds.setdefault(section, set()).add(value)

    @functools.cache
    def are_files(setting: tuple[str, ...]) -> bool:
        section, *rest = setting
        configs = [config_of(section, kind) for kind in kinds.get(section, {None})]
        return any(c is not None and rest[0] in file_settings(c) for c in configs if rest)

    return are_files


def _setting(keys: tuple[str, ...]) -> tuple[str, ...]:
    """Return the section and the setting that keys in a file lead to, without items of lists."""
    keys = keys[1:] if keys[0] == "sweep" else keys
    inner = ".".join(keys[AROUND.get(keys[0], 0) :] if keys else ())
    return tuple(key for key in inner.split(".") if not key.isdecimal())


def _settings(value: Any, keys: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Yield each plain value of a table, with its section and setting."""
    match value:
        case dict():
            for key, item in value.items():
                yield from _settings(item, (*keys, key))
        case list():
            for item in value:
                yield from _settings(item, keys)
        case _:
            yield _setting(keys), value


def _changed(
    value: Any, are_files: Callable[[tuple[str, ...]], bool], change: Change, *keys: str
) -> Any:
    """Return a table in which the names of files are changed."""
    match value:
        case dict():
            return {k: _changed(item, are_files, change, *keys, k) for k, item in value.items()}
        case list():
            return [_changed(item, are_files, change, *keys) for item in value]
        case str() if are_files(_setting(keys)[:2]):
            return change(value)
        case _:
            return value
