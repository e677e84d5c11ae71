"""TOML texts as tables; what would fail later is refused here, in one sentence."""

from __future__ import annotations

import math
import tomllib
from pathlib import Path
from typing import Any

from servo.mistake import Mistake
from sim.files import reading

LARGEST = 1_000_000
"""Largest file [bytes]."""
DEEPEST = 20
"""Most tables and lists inside each other."""
INTEGERS = range(-(1 << 63), 1 << 63)
"""The integers that TOML has."""


def read(path: Path, what: str) -> str:
    """The text of a file.

    Args:
        path: Where it is.
        what: What it should be, for messages: "scenario".

    Raises:
        Mistake: It cannot be read, is not a regular file, is not UTF-8 text, or is too large.
    """
    try:
        return reading.text(path, what, LARGEST)
    except ValueError as error:
        raise Mistake(str(error)) from None


def decode(text: str, place: str) -> dict[str, Any]:
    """The table of a TOML text; place names it in messages.

    Raises:
        Mistake: It is no TOML, or as for `check`.
    """
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise Mistake(f"{place}: this is not TOML: {error}") from None
    except RecursionError:
        raise Mistake(f"{place}: {_too_deep()}") from None
    except ValueError:  # Python's own limit on the digits of an integer
        raise Mistake(f"{place}: {_too_large()}") from None
    check(table, place)
    return table


def check(value: Any, place: str, depth: int = 0) -> None:
    """Refuse what could not be quoted in a message, or written as JSON.

    Raises:
        Mistake: An integer has more than 64 bits, a text is not Unicode, or tables and lists lie
            too deep in each other.
    """
    if depth > DEEPEST:
        raise Mistake(f"{place}: {_too_deep()}")
    match value:
        case dict():
            for key, item in value.items():
                check(key, place, depth + 1)
                check(item, place, depth + 1)
        case list():
            for item in value:
                check(item, place, depth + 1)
        case int() if value not in INTEGERS:
            raise Mistake(f"{place}: {_too_large()}")
        case str() if not value.isascii() and _has_surrogates(value):
            raise Mistake(f"{place}: {value!r} is not a Unicode text")
        case _:
            pass


def is_number(value: Any) -> bool:
    """Whether a value is a finite number, which true and false are not."""
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _too_deep() -> str:
    return f"tables and lists lie too deep in each other; the limit is {DEEPEST}"


def _too_large() -> str:
    return f"an integer is too large; the limit is {INTEGERS[-1]}"


def _has_surrogates(text: str) -> bool:
    """Whether there are halves of characters in it, as in a file's name that is not UTF-8."""
    return any("\ud800" <= c <= "\udfff" for c in text)
