"""Reading of TOML texts as nested dictionaries (tables), and changes of the settings in them by
dotted paths such as "tracker.kind".
"""

import math
import re
import tomllib
from os import PathLike, fspath
from pathlib import Path
from typing import TypeGuard

import numpy as np

from servo.mistake import Mistake, as_mistake
from servo.scenario.catalogue import LISTS, PLUGINS
from sim.files import reading
from sim.installed import Trusted

Table = dict[str, object]
"""A table of TOML, or the whole of a TOML file."""
LARGEST_FILE = 1_000_000
"""Largest file that is read [bytes]; a scenario has a few thousand."""
DEEPEST = 20
"""Deepest nesting of tables and lists."""
SAME_TIME = {"run.latency": "run.latency_ms", "run.latency_ms": "run.latency"}
"""Settings of one quantity in two units: a change of one removes the other."""
INTEGERS = range(-(1 << 63), 1 << 63)
"""The integers that TOML has."""
TOO_DEEP = f"tables and lists are nested too deep; the limit is {DEEPEST} levels"


def read(path: Path, what: str) -> str:
    """Return the text of a file of at most 1 MB.

    Args:
        path: The file.
        what: Kind of the file in messages, such as "scenario".

    Raises:
        Mistake: The file cannot be read, is not a regular file, is not UTF-8 text, or is too large.
    """
    with as_mistake():
        return reading.text(path, what, LARGEST_FILE)


def decode(text: str, place: str) -> Table:
    """Parse a TOML text, and return its table.

    Args:
        text: The text.
        place: Name of the text's file, which begins messages.

    Raises:
        Mistake: The text is not TOML, or has an invalid value: an integer of more than 64 bits, or
            tables and lists that are nested too deep.
    """
    try:
        table = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise Mistake(f"{place}: this is not TOML: {error}") from None
    check(table, place)
    return table


def check(value: object, place: str, depth: int = 0) -> None:
    """Check that a value of TOML, and all values in its tables and lists, can be quoted in messages
    and written as JSON.

    Args:
        value: The value.
        place: File and key of the value, for messages.
        depth: Number of tables and lists around the value; callers leave it out.

    Raises:
        Mistake: An integer has more than 64 bits, a text is not Unicode, or tables and lists are
            nested more than 20 deep.
    """
    if depth > DEEPEST:
        raise Mistake(f"{place}: {TOO_DEEP}")
    match value:
        case dict():
            for key, item in value.items():
                check(key, place, depth + 1)
                check(item, place, depth + 1)
        case list():
            for item in value:
                check(item, place, depth + 1)
        case int() if value not in INTEGERS:
            raise Mistake(
                f"{place}: an integer has more than 64 bits; give one from {INTEGERS[0]} to "
                f"{INTEGERS[-1]}"
            )
        # Halves of a character, which no Unicode text has.
        case str() if not value.isascii() and re.search("[\ud800-\udfff]", value):
            raise Mistake(f"{place}: {value!r} is not a Unicode text: correct it")
        case _:
            pass


def copied(table: Table) -> Table:
    """Return a copy of a table in which inner tables and lists are copied too."""
    return {key: _copied(value) for key, value in table.items()}


def _copied(value: object) -> object:
    """Return a copy of a table or list with all inner ones, or any other value itself, which nobody
    can change; this takes a fifth of the time of `copy.deepcopy`.
    """
    match value:
        case dict():
            return {key: _copied(item) for key, item in value.items()}
        case list():
            return [_copied(item) for item in value]
        case _:
            return value


def is_table(value: object) -> TypeGuard[Table]:
    """Return whether a value of TOML is a table, which is a dictionary in Python."""
    return isinstance(value, dict)


def is_number(value: object) -> TypeGuard[float]:
    """Return whether a value of TOML is a finite number; True and False do not count as numbers."""
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def names_of(path: str) -> list[str]:
    """Return the names in a dotted path, without spaces around them; a name in quotes may contain
    dots.

    >>> names_of('expect.tracker."my.kind"')
    ['expect', 'tracker', 'my.kind']
    """
    hidden = re.sub(r'"([^"]*)"', lambda quoted: quoted[1].replace(".", "\0"), path)
    return [name.strip().replace("\0", ".") for name in hidden.split(".")]


def assignment(item: str) -> tuple[str, object]:
    """Split a text "a.b=value", as given to the option --set, and return the path and the value. A
    value that is not TOML is a text, and so is a number, a flag or a list if the path ends in
    `kind`.

    >>> assignment("tracker.kind=frozen")
    ('tracker.kind', 'frozen')

    Raises:
        Mistake: The text does not have that form.
    """
    path, equals, text = item.partition("=")
    names = names_of(path)
    if not equals or not all(names):
        raise Mistake(f"--set {item}: this is not key=value, such as tracker.kind=frozen")
    value = _value(text.strip())
    if names[-1] == "kind" and not isinstance(value, str | dict):  # "true" is a word there
        value = Trusted(text.strip())
    return path.strip(), value


def put(table: Table, path: str, value: object, place: str) -> None:
    """Set a value in a scenario's table, in place, and remove the random distribution of this
    setting from its table [vary].

    Args:
        table: The scenario's table.
        path: The setting, such as "tracker.kind"; a new `kind` clears the other settings of its
            table.
        value: The new value.
        place: The file, option or keyword that gives the change; it begins messages.

    Raises:
        Mistake: The path goes through a value that is not a table, has more than 20 names, or ends
            in a list without such an item.
    """
    *above, name = keys = names_of(path)
    if len(keys) > DEEPEST:
        raise Mistake(f"{place}: {TOO_DEEP}")
    at: Table | list[object] = table
    for key in above:
        inner = _inside(at, key, [] if at is table and key in LISTS else {})
        if not isinstance(inner, dict | list):
            raise Mistake(
                f"{place}: '{path}' leads through '{key}', which is not a table: correct it"
            )
        at = inner
    _forget(table, keys)
    if isinstance(at, list):  # a number of start.pose, but no whole disturbance
        if not name.isdecimal() or isinstance(_inside(at, name, None), dict | None):
            raise Mistake(
                f"{place}: '{path}' should end with the number of an item that is there and is no "
                "table, counted from 0, such as start.pose.2, or with a key of a table there, "
                "such as disturbances.0.start"
            )
        at[int(name)] = value
        return
    _, default = PLUGINS.get(keys[0], ("", None))
    if name == "kind" and at.get("kind", default) != value:
        at.clear()
        _forget(table, above)
    at[name] = value


def with_settings(table: Table, settings: Table, place: str) -> Table:
    """Return a copy of a scenario's table in which some settings have other values, and the random
    distributions of these settings are removed from its table [vary]; so is the setting of the same
    quantity in another unit.

    Args:
        table: The scenario's table.
        settings: New values by path, such as "tracker.kind"; a new `kind` clears the other settings
            of its table, so kinds are set first.
        place: The file or option that gives the changes; it begins messages.

    Raises:
        Mistake: A path goes through a value that is not a table, has more than 20 names, or ends in
            a list without such an item.
    """
    changed = copied(table)
    for key in sorted(settings, key=lambda key: not key.endswith(".kind")):
        if key in SAME_TIME:
            drop(changed, SAME_TIME[key])
        put(changed, key, settings[key], place)
    return changed


def merged(base: Table, own: Table) -> Table:
    """Return a copy of the table `base` with the values of `own` in place of its own; tables that
    both have are merged in the same way.
    """
    found = copied(base)
    for key, value in own.items():
        before = found.get(key)
        found[key] = merged(before, value) if is_table(before) and is_table(value) else value
    return found


def drop(table: Table, path: str) -> None:
    """Remove a setting such as "run.latency", if it is there, from a scenario's table, in place,
    and also its random distribution in the table [vary].

    Args:
        table: The scenario's table.
        path: The setting: the name of a table and a name in it.
    """
    section, name = names_of(path)
    at = table.get(section)
    if is_table(at):
        at.pop(name, None)
    _forget(table, [section, name])


def _forget(table: Table, keys: list[str]) -> None:
    """Remove the distribution of a setting from a scenario's table [vary], in place; `keys` are the
    names in the setting's dotted path.
    """
    at = table.get("vary")
    for key in keys[:-1]:
        at = at.get(key) if is_table(at) else None
    if is_table(at):
        at.pop(keys[-1], None)


def _inside(at: Table | list[object], key: str, usual: object) -> object:
    """Return the value under a key of a table, which is first set to `usual` if it is missing. Of a
    list, return the item at an index such as "0", or None if the list has no such item.
    """
    if isinstance(at, dict):
        return at.setdefault(key, usual)
    return at[int(key)] if key in map(str, range(len(at))) else None


def _value(text: str) -> object:
    """Parse a value of the command line; one that is not TOML is returned as text."""
    try:
        parsed = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError):  # not TOML, or too deep
        return Trusted(text)
    return plain(parsed["value"] if len(parsed) == 1 else text)


def plain(value: object) -> object:
    """Convert a value of Python or NumPy to the types of TOML: arrays and tuples become lists,
    numbers of NumPy those of Python, and paths texts, also inside dictionaries and lists. A value
    of another type is returned unchanged.

    Texts become `Trusted`: the user wrote them on the command line or in Python, so they may name
    modules to import and programs to start, which texts of a file may not.
    """
    match value:
        case str():
            return Trusted(value)
        case dict():
            return {key: plain(item) for key, item in value.items()}
        case list() | tuple():
            return [plain(item) for item in value]
        case _ if hasattr(value, "tolist"):  # of NumPy
            return plain(np.asarray(value).tolist())
        case PathLike():
            return Trusted(fspath(value))
        case _:
            return value
