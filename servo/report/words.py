"""Values as text on a page."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from tracking.evaluation.statistics import Interval

NOTHING = "\N{EN DASH}"
LARGE, HUGE = 100, 1e6


def shown(value: Any) -> str:
    """A value with three digits, or all digits of its whole part; a dash if there is none."""
    if value is None:
        return NOTHING
    if isinstance(value, bool):
        return "yes" if value else "no"
    if not isinstance(value, float):
        return str(value)
    if not math.isfinite(value):
        return NOTHING
    return f"{value:,.0f}" if LARGE <= abs(value) < HUGE else f"{value:.3g}"


def spread(interval: Interval | None) -> str:
    """A value with its interval, such as "2.1 (1.9 to 2.4)"."""
    if interval is None:
        return NOTHING
    if interval.low == interval.high:
        return shown(interval.value)
    return f"{shown(interval.value)} ({shown(interval.low)} to {shown(interval.high)})"


def listed(settings: Mapping[str, Any]) -> str:
    """Settings in a line, such as "camera.rate = 5, tracker.kind = kams"."""
    return ", ".join(f"{key} = {shown(value)}" for key, value in settings.items())


def cut(what: str, found: Sequence[Any], most: int) -> str | None:
    """A sentence if only the first of a list are shown; None if all are."""
    return f"The first {most} of {len(found):,} {what} are shown." if len(found) > most else None
