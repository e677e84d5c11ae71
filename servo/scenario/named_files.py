"""Finds the files of scenarios and studies, and the files (models, pictures, ...) that their
settings name, and computes SHA-256 digests of the latter.

A setting names a file if its type is or contains `sim.ranges.File`, and a file or a folder if it is
`sim.ranges.FileOrFolder`.
"""

import functools
import hashlib
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import fields
from importlib import resources
from pathlib import Path
from typing import Any, Protocol, get_args, get_type_hints

from servo.mistake import Mistake, unknown
from servo.scenario import toml
from servo.scenario.catalogue import shipped, studies
from servo.scenario.tables import config_of
from servo.scenario.toml import Table
from sim.files.behind import files_behind
from sim.files.picture_name import SKIMAGE, packaged
from sim.files.shipped import warn_of_own, warn_of_shipped
from sim.installed import Trusted
from sim.ranges import NamesFile, NamesFolder

MISSING = "missing"
"""Digest of a file that cannot be read."""
DIGITS = 12
"""Digits of a digest: 48 bits do not collide by chance among the files of a study."""
BESIDE = (".csv", ".txt", ".yaml")
"""Suffixes of the truth and the calibration beside a recording."""
AROUND = {"vary": 1, "set": 1, "axes": 1, "named": 3}
"""Tables whose keys are settings of other tables, and the number of keys before each setting."""


def read(name: str) -> tuple[Table, str]:
    """Return the table of a scenario's TOML file, whose settings are not checked yet, and the
    file's name without folder, such as "still.toml".

    Args:
        name: Name of a shipped scenario, or path of a TOML file. If a setting in this file names a
            file in the same folder, the name becomes an absolute path; other names stay relative to
            the working directory.

    Raises:
        Mistake: There is no such scenario or file, it cannot be read, or it is not valid TOML.
    """
    path = path_of(name)
    table = toml.decode(toml.read(path, "scenario"), path.name)
    return (table if name in shipped() else found_beside(table, path.parent)), path.name


def path_of(name: str, what: str = "scenario") -> Path:
    """Return the path of a scenario's or study's TOML file.

    Args:
        name: Name of a shipped scenario or study, or a path that ends in .toml, which is returned
            as it is and need not exist.
        what: "scenario" or "study".

    Raises:
        Mistake: No scenario or study of this name is shipped.
    """
    path = Path(name)
    if path.suffix == ".toml":
        return path
    known, folder = (studies(), "studies/") if what == "study" else (shipped(), "")
    if name not in known:
        raise Mistake(f"{unknown(name, known, what)} (or give a .toml file)")
    warn_of_own(name, f"{name}.toml", what)
    return Path(str(resources.files("scenes") / f"{folder}{name}.toml"))


@functools.cache
def file_settings(config: type[Any], mark: type[NamesFile] = NamesFile) -> frozenset[str]:
    """Return the names of the settings in a dataclass whose values are names of files; no names if
    the dataclass has annotations that cannot be evaluated.

    Args:
        config: The dataclass of settings.
        mark: `NamesFile` for all these settings, `NamesFolder` for those only that may name a
            folder too.
    """
    with suppress(Exception):
        hints = get_type_hints(config, include_extras=True)
        return frozenset(each.name for each in fields(config) if _has(hints[each.name], mark))
    return frozenset()


def _has(hint: object, mark: type[NamesFile]) -> bool:
    """Return whether a type, or one that it contains as `File | None` does, has a mark."""
    marks = getattr(hint, "__metadata__", ())
    return any(isinstance(m, mark) for m in marks) or any(_has(h, mark) for h in get_args(hint))


def found_beside(table: Table, folder: Path, *bases: Table) -> Table:
    """Return a copy of the table of a scenario or study in which the names of files that exist
    beside it are absolute paths.

    Names of files that are not in the folder stay as they are, as do names that the user gave on
    the command line: both are relative to the working directory.

    Args:
        table: The table, as read from its file.
        folder: The folder of that file.
        *bases: Tables of a study's scenarios, which name the kinds of components that the study's
            settings belong to.
    """

    def whole(name: str, *, may_be_folder: bool) -> str:
        if isinstance(name, Trusted):
            return name
        with suppress(OSError, RuntimeError, ValueError):  # no file can have this name
            path = (folder / name).resolve()
            if path.is_file() or (may_be_folder and name and path.is_dir()):
                warn_of_shipped(name)
                return str(path)
        return name

    return _changed(table, _kinds_in((table, *bases)), whole)


def named_in(*tables: Table) -> list[str]:
    """Return the names of the files that the settings in tables name, in the order of the tables; a
    name may repeat.

    Args:
        *tables: Tables of scenarios, or of a study and its scenarios.
    """
    found: list[str] = []

    def note(name: str, *, may_be_folder: bool) -> str:
        del may_be_folder
        found.append(name)
        return name

    kinds = _kinds_in(tables)
    for table in tables:
        _changed(table, kinds, note)
    return found


def named_by(config: object) -> list[str]:
    """Return the names of the files that the settings (`Config`) of a component name, "" for a
    setting without a file.
    """
    values = [getattr(config, name) for name in sorted(file_settings(type(config)))]
    each = (value if isinstance(value, tuple) else [value] for value in values)
    return [name for names in each for name in names if isinstance(name, str)]


def digests(names: Iterable[str]) -> dict[str, str]:
    """Return digests by name of file: 12 hexadecimal digits of SHA-256 of each file together with
    those that it refers to, such as meshes. Names of files that cannot be read are left out. A file
    that has the name of a shipped one causes a warning.
    """
    found = {name: digest_of(name) for name in names}
    own = {name: digest for name, digest in found.items() if digest != MISSING}
    for name in own:
        warn_of_shipped(name)
    return own


def digest_of(name: str) -> str:
    """Return a digest, 12 hexadecimal digits of SHA-256, of a file together with those that it
    refers to or that belong to it, such as a model's meshes or a recording's truth; for a folder,
    of all files in it. The result is "missing" if there is no such file, or one of them cannot be
    read.
    """
    try:
        files = sorted(_files(name))
        each = [_digest(f, f.stat().st_mtime_ns, f.stat().st_size) for f in files]
    except (OSError, ValueError):
        return MISSING
    return hashlib.sha256(" ".join(each).encode()).hexdigest()[:DIGITS] if each else MISSING


def _files(name: str) -> set[Path]:
    """Return a file and those that it refers to, or all files of a folder; no files if there is
    neither. The truth of a recording has the recording's name with another suffix.
    """
    path = packaged(name, "picture") if name.startswith(SKIMAGE) else Path(name)
    if name and path.is_dir():
        return {each for each in path.rglob("*") if each.is_file()}
    if not path.is_file():
        return set()
    beside = {path.with_suffix(suffix) for suffix in BESIDE}
    return files_behind(path) | {each for each in beside if each.is_file()}


@functools.lru_cache(maxsize=100_000)
def _digest(path: Path, changed: int, size: int) -> str:
    """Return the SHA-256 digest of a file. It is cached until the file's time of change `changed`
    [ns] or its `size` [bytes] differs.
    """
    del changed, size
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


class Change(Protocol):
    """Function that is called for each name of a file in a setting, and returns the name that
    replaces it.
    """

    def __call__(self, name: str, /, *, may_be_folder: bool) -> str:
        """Return the new name of a file.

        Args:
            name: The name in the setting.
            may_be_folder: Whether the setting may also name a folder.
        """
        ...


def _kinds_in(tables: Iterable[Table]) -> Mapping[str, set[str]]:
    """Return the kinds of components that tables name, by section."""
    kinds = defaultdict[str, set[str]](set)

    def note_kind(section: str, setting: str, text: str) -> str:
        if setting == "kind":
            kinds[section].add(text)
        return text

    for each in tables:
        _visited(each, note_kind)
    return kinds


def _changed(table: Table, kinds: Mapping[str, set[str]], change: Change) -> Table:
    """Return a table in which each name of a file is replaced by `change` of it.

    Args:
        table: The table.
        kinds: Kinds of components by section, on which it depends which settings name files.
        change: Returns the new name.
    """

    def changed(section: str, setting: str, text: str) -> str:
        each = [config_of(section, kind) for kind in kinds.get(section) or [None]]
        configs = [config for config in each if config is not None]
        is_file = any(setting in file_settings(config) for config in configs)
        is_folder = any(setting in file_settings(config, NamesFolder) for config in configs)
        return change(text, may_be_folder=is_folder) if is_file else text

    return _visited(table, changed)


def _visited(value: Any, visit: Callable[[str, str, str], str], *keys: str) -> Any:
    """Return a value of TOML in which each text is replaced by `visit` of its table, its setting
    and itself; `keys` are those that lead to the value.
    """
    match value:
        case dict():
            return {key: _visited(item, visit, *keys, key) for key, item in value.items()}
        case list():
            return [_visited(item, visit, *keys) for item in value]
        case str():
            section, *settings = ".".join(keys[AROUND.get(keys[0], 0) :]).split(".")
            named = [key for key in settings if not key.isdecimal()]  # no item of a list
            return visit(section, named[0], value) if named else value
        case _:
            return value
