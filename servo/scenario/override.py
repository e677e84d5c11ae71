"""Changes of a TOML table by dotted paths, such as "tracker.kind=frozen" on the command line."""

from __future__ import annotations

import tomllib
from typing import Any

from servo.mistake import Mistake
from servo.scenario.catalogue import LISTS, PLUGINS
from sim.installed import Trusted

Table = dict[str, Any]


def override(table: Table, item: str) -> None:
    """Apply one "a.b=value" to a table, as `put` does.

    Raises:
        Mistake: It has not that form, or as for `put`.
    """
    put(table, *assignment(item), f"--set {item}")


def assignment(item: str) -> tuple[str, Any]:
    """Path and value of one "a.b=value"; what is no TOML is a word.

    Raises:
        Mistake: It has not that form.
    """
    path, equals, text = item.partition("=")
    keys = [key.strip() for key in path.split(".")]
    if not equals or not all(keys):
        raise Mistake(f"--set {item}: this should be key=value, such as tracker.kind=frozen")
    value = _value(text.strip())
    if keys == ["estimator", "kind"] and value is True:  # the kind "true"
        value = Trusted(text.strip())
    return ".".join(keys), value


def put(table: Table, path: str, value: Any, place: str) -> None:
    """Set the value at a path such as "tracker.kind"; another `kind` clears its table first.

    Raises:
        Mistake: The path leads through something that is no table; place names it.
    """
    keys = [key.strip() for key in path.split(".")]
    at: Any = table
    for key in keys[:-1]:
        try:
            at = _inside(at, key, [] if at is table and key in LISTS else {})
        except (ValueError, IndexError):
            at = None
        if not isinstance(at, dict | list):
            raise Mistake(f"{place}: '{path}' leads through '{key}', which is not a table")
    if not isinstance(at, dict):
        raise Mistake(f"{place}: '{path}' is not a key of a table")
    _, default = PLUGINS.get(keys[0], ("", None))
    if keys[-1] == "kind" and at.get("kind", default) != value:
        at.clear()
    at[keys[-1]] = value


def _inside(at: Any, key: str, usual: Any) -> Any:
    """What lies in a table or a list under a key; `usual` where a table has no such key.

    Raises:
        ValueError: The key is no index of a list, as 0, 1, 2 are.
        IndexError: The list is shorter.
    """
    if not isinstance(at, list):
        return at.setdefault(key, usual)
    if not key.isdecimal() or str(int(key)) != key:
        raise ValueError(key)
    return at[int(key)]


def _value(text: str) -> Any:
    try:
        parsed = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError):  # no TOML, or no end of it
        return Trusted(text)
    return trusted(parsed["value"] if len(parsed) == 1 else text)


def trusted(value: Any) -> Any:
    """The same value with all its texts trusted: it comes from the command line or from Python."""
    match value:
        case str():
            return Trusted(value)
        case list():
            return [trusted(item) for item in value]
        case dict():
            return {key: trusted(item) for key, item in value.items()}
        case _:
            return value
