"""Values as JSON, which has neither infinity nor nan."""

from __future__ import annotations

import json
import math
from typing import Any


def number(value: float) -> float | None:
    """A number for JSON: None where it is infinite or nan."""
    return value if math.isfinite(value) else None


def json_text(document: Any) -> str:
    """The text of a JSON file; an enum is written as its value.

    Raises:
        ValueError: A number is infinite or nan.
    """
    text = json.dumps(document, indent=1, allow_nan=False, default=lambda e: e.value)
    return text + "\n"
