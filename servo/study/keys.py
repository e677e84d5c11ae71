"""Names of settings in a study: dotted keys, each spelled in one way and given once."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from servo.mistake import Mistake


def spelled(key: str, place: str) -> str:
    """A dotted key without the spaces around its names.

    Raises:
        Mistake: One of its names is empty; place says where it stands.
    """
    names = [name.strip() for name in key.split(".")]
    if not all(names):
        raise Mistake(f"{place}: '{key}' is not the name of a setting, such as run.latency")
    return ".".join(names)


def flat(table: Mapping[str, Any], place: str, ends: Iterable[str] = ()) -> dict[str, Any]:
    """Nested tables by dotted keys; a table with one of the keys in `ends` is a value, an empty one
    too.

    Raises:
        Mistake: A key is given twice, in whatever spelling, or has an empty name.
    """
    found: dict[str, Any] = {}
    for key, value in _leaves(table, frozenset(ends)):
        name = spelled(key, place)
        if name in found:
            raise Mistake(f"{place}: {name} is given twice")
        found[name] = value
    return found


def _leaves(table: Mapping[str, Any], ends: frozenset[str]) -> Iterable[tuple[str, Any]]:
    for key, value in table.items():
        if isinstance(value, dict) and value and ends.isdisjoint(value):
            yield from ((f"{key}.{inner}", v) for inner, v in _leaves(value, ends))
        else:
            yield key, value


def check_apart(keys: Mapping[str, str], place: str) -> None:
    """Refuse keys of which one lies in the table that another one sets as a whole.

    Args:
        keys: Where each key stands in the study, by key.
        place: The study's file.

    Raises:
        Mistake: There are such keys.
    """
    for key, at in keys.items():
        names = key.split(".")
        for n in range(1, len(names)):
            whole = ".".join(names[:n])
            if whole in keys:
                raise Mistake(f"{place}: {at}: {keys[whole]} sets all of {whole} already")
