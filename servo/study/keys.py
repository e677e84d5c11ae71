"""Dotted keys of settings in a study: spelled in one way, and given once."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from servo.mistake import Mistake


def spelled(key: str, place: str) -> str:
    """A dotted key without the spaces around its names.

    Raises:
        Mistake: One of its names is empty; the message begins with `place`.
    """
    names = [name.strip() for name in key.split(".")]
    if not all(names):
        raise Mistake(f"{place}: '{key}' is not the name of a setting, such as run.latency")
    return ".".join(names)


def flat(table: Mapping[str, Any], place: str, ends: Iterable[str] = ()) -> dict[str, Any]:
    """The values of nested tables by dotted keys; an empty table, or one with a key from `ends`, is
    a value.

    Raises:
        Mistake: A key is given twice, also in different spellings, or has an empty name.
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
    """Refuse a key inside a table that another key sets as a whole.

    Args:
        keys: The place of each key in the study, by key.
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
