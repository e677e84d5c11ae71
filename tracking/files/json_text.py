"""Conversion of values to JSON, which has no infinity, nan or invalid characters."""

import dataclasses
import json
import math
from enum import Enum
from typing import Any

import numpy as np


def number(value: float) -> float | None:
    """Return a number for JSON: None for infinity and nan."""
    return value if math.isfinite(value) else None


def as_json(value: Any) -> Any:
    """Return a value in the types of JSON.

    A dataclass becomes a table, an enum its value, infinity and nan None, any other type its text.
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
            return str(value)


def json_text(document: Any) -> str:
    """Return the text of a JSON file with a value that `as_json` converts."""
    return json.dumps(as_json(document), indent=1, allow_nan=False, ensure_ascii=False) + "\n"
