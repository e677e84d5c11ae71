"""Results of runs: those with something in common, their measures, and a mean in words."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from sim.types import Array
from tracking.evaluation.statistics import Interval, bootstrap

Result = dict[str, Any]


def group(results: Sequence[Result], **wanted: Any) -> list[Result]:
    """The results with these values."""
    return [r for r in results if all(r[key] == value for key, value in wanted.items())]


def by_tracker(results: Sequence[Result]) -> dict[str, list[Result]]:
    """The results of each tracker, in their order."""
    return {label: group(results, tracker=label) for label in dict.fromkeys(
        r["tracker"] for r in results)}  # fmt: skip


def column(results: Sequence[Result], measure: str) -> Array:
    """A measure over results (n,); nan where it does not apply."""
    found = [r["measures"][measure] for r in results]
    return np.array([np.nan if v is None else v for v in found], dtype=float)


def words(interval: Interval, unit: str = "") -> str:
    """Such as "2.1 px (1.9 to 2.4)"."""
    value = f"{interval.value:.3g} {unit}".rstrip()
    return f"{value} ({interval.low:.3g} to {interval.high:.3g})"


def mean(results: Sequence[Result], measure: str, unit: str = "") -> str:
    """The mean of a measure with its interval, in words."""
    return words(bootstrap(column(results, measure)), unit)
