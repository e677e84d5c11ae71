"""Conversion of values to JSON, which cannot hold infinity, nan or invalid characters."""

import dataclasses
import json
import math
from enum import Enum
from typing import Any

import numpy as np


def number(value: float) -> float | None:
    """Return a number as JSON can hold it: None for infinity and nan."""
    return value if math.isfinite(value) else None


def as_json(value: object) -> Any:
    """Return a value converted to dict, list, str, int, float, bool or None.

    A dataclass becomes a dict of its fields, an enum member its value, a tuple or an array a list,
    a number of NumPy a plain number, and infinity and nan become None. The keys of a dict and
    values of any other type become text. In a str or a key, ? replaces a character that UTF-8 does
    not have.
    """
    match value:
        case bool() | int() | None:
            return value
        case float():
            return number(float(value))
        case str():
            return value.encode(errors="replace").decode()
        case Enum():
            return as_json(value.value)
        case dict():
            return {as_json(str(key)): as_json(item) for key, item in value.items()}
        case list() | tuple():
            return [as_json(item) for item in value]
        case np.ndarray() | np.generic():
            return as_json(value.tolist())
        case _ if dataclasses.is_dataclass(value):
            return {f.name: as_json(getattr(value, f.name)) for f in dataclasses.fields(value)}
        case _:
            return as_json(str(value))


def json_line(value: object) -> str:
    """Return a value, converted as `as_json` does, as JSON in one line."""
    return json.dumps(as_json(value), allow_nan=False, ensure_ascii=False, separators=(",", ":"))


def json_text(document: object) -> str:
    """Return a value, converted as `as_json` does, as the text of a JSON file, with a newline at
    its end.
    """
    return json.dumps(as_json(document), indent=1, allow_nan=False, ensure_ascii=False) + "\n"
