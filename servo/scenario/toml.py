"""TOML texts as tables, which are checked and changed by dotted paths such as "tracker.kind"."""

import copy
import math
import re
import tomllib
from pathlib import Path
from typing import Any

from servo.mistake import Mistake, as_mistake
from servo.scenario.catalogue import LISTS, PLUGINS
from sim.files import reading
from sim.installed import Trusted

Table = dict[str, Any]
LARGEST_FILE = 1_000_000
"""Largest file [bytes]; a scenario has a few thousand."""
DEEPEST = 20
"""Most tables and lists inside each other."""
INTEGERS = range(-(1 << 63), 1 << 63)
"""The integers that TOML has."""
TOO_DEEP = f"tables and lists lie too deep in each other; the limit is {DEEPEST}"
TOO_LARGE = f"an integer is too large; the limit is {INTEGERS[-1]}"


def read(path: Path, what: str) -> str:
    """Return the text of a file.

    Args:
        path: Where it is.
        what: Kind of the file in messages, such as "scenario".

    Raises:
        Mistake: It cannot be read, is not a regular file, is not UTF-8 text, or is too large.
    """
    with as_mistake():
        return reading.text(path, what, LARGEST_FILE)


def decode(text: str, place: str) -> Table:
    """Return the table of a TOML text; place names it in messages.

    Raises:
        Mistake: The text is not TOML, or as for `check`.
    """
    try:
        table = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise Mistake(f"{place}: this is not TOML: {error}") from None
    check(table, place)
    return table


def check(value: Any, place: str, depth: int = 0) -> None:
    """Refuse a value that cannot be quoted in a message or written as JSON.

    Raises:
        Mistake: An integer has more than 64 bits, a text is not Unicode, or tables and lists lie
            too deep in each other.
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
            raise Mistake(f"{place}: {TOO_LARGE}")
        case str() if any("\ud800" <= c <= "\udfff" for c in value):  # halves of characters
            raise Mistake(f"{place}: {value!r} is not a Unicode text")
        case _:
            pass


def is_number(value: Any) -> bool:
    """Return whether a value is a finite number, which true and false are not."""
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def names_of(path: str) -> list[str]:
    """Return the names in a dotted path; one in quotes may have dots itself.

    >>> names_of('expect.tracker."my.kind"')
    ['expect', 'tracker', 'my.kind']
    """
    hidden = re.sub(r'"([^"]*)"', lambda quoted: quoted[1].replace(".", "\0"), path)
    return [name.strip().replace("\0", ".") for name in hidden.split(".")]


def assignment(item: str) -> tuple[str, Any]:
    """Return path and value of one "a.b=value"; a value that is not TOML is a text.

    >>> assignment("tracker.kind=frozen")
    ('tracker.kind', 'frozen')

    Raises:
        Mistake: The text does not have that form.
    """
    path, equals, text = item.partition("=")
    names = names_of(path)
    if not equals or not all(names):
        raise Mistake(f"--set {item}: this should be key=value, such as tracker.kind=frozen")
    value = _value(text.strip())
    if names[-1] == "kind" and not isinstance(value, str | dict):  # "true" is a word there
        value = Trusted(text.strip())
    return path.strip(), value


def put(table: Table, path: str, value: Any, place: str) -> None:
    """Set the value at a path such as "tracker.kind"; another `kind` clears its table first.

    Raises:
        Mistake: The path leads through a value that is not a table; `place` begins the message.
    """
    *above, name = keys = names_of(path)
    if len(keys) > DEEPEST:
        raise Mistake(f"{place}: {TOO_DEEP}")
    at: Any = table
    for key in above:
        at = _inside(at, key, [] if at is table and key in LISTS else {})
        if not isinstance(at, dict | list):
            raise Mistake(f"{place}: '{path}' leads through '{key}', which is not a table")
    _forget(table, keys)
    if isinstance(at, list):  # a number of start.pose, but no whole disturbance
        if not name.isdecimal() or isinstance(_inside(at, name, None), dict | None):
            raise Mistake(f"{place}: '{path}' is not a key of a table")
        at[int(name)] = value
        return
    _, default = PLUGINS.get(keys[0], ("", None))
    if name == "kind" and at.get("kind", default) != value:
        at.clear()
        _forget(table, above)
    at[name] = value


def with_settings(table: Table, settings: Table, place: str) -> Table:
    """Return a copy of a table with settings at their paths, as by `put`."""
    changed = copy.deepcopy(table)
    for key, value in settings.items():
        put(changed, key, value, place)
    return changed


def drop(table: Table, path: str) -> None:
    """Remove a setting such as "run.latency" and its draw from a table."""
    section, name = names_of(path)
    at = table.get(section)
    if isinstance(at, dict):
        at.pop(name, None)
    _forget(table, [section, name])


def _forget(table: Table, keys: list[str]) -> None:
    """Remove the draw of a setting that is set now."""
    at = table.get("vary")
    for key in keys[:-1]:
        at = at.get(key) if isinstance(at, dict) else None
    if isinstance(at, dict):
        at.pop(keys[-1], None)


def _inside(at: Any, key: str, usual: Any) -> Any:
    """Return the value under a key; if it is missing, `usual` in a table and None in a list."""
    if isinstance(at, dict):
        return at.setdefault(key, usual)
    return at[int(key)] if key in map(str, range(len(at))) else None


def _value(text: str) -> Any:
    try:
        parsed = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError):  # not TOML, or too deep
        return Trusted(text)
    return plain(parsed["value"] if len(parsed) == 1 else text)


def plain(value: Any) -> Any:
    """Return a value of the command line, of Python or of NumPy in the types of TOML, its texts
    trusted.
    """
    match value:
        case str():
            return Trusted(value)
        case dict():
            return {key: plain(item) for key, item in value.items()}
        case list() | tuple():
            return [plain(item) for item in value]
        case _ if hasattr(value, "tolist"):
            return plain(value.tolist())
        case _ if hasattr(value, "__fspath__"):
            return Trusted(value)
        case _:
            return value
