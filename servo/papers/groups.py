"""Results of runs: those with something in common, their measures, differences and ratios."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from sim.types import Array
from tracking.statistics.comparisons import Interval, difference_of_shares, mean_of

Result = dict[str, Any]


def group(results: Sequence[Result], **wanted: Any) -> list[Result]:
    """The results with these values."""
    return [r for r in results if all(r[key] == value for key, value in wanted.items())]


def by_tracker(results: Sequence[Result]) -> dict[str, list[Result]]:
    """The results of each tracker, in their order."""
    return {
        label: group(results, tracker=label)
        for label in dict.fromkeys(r["tracker"] for r in results)
    }


def column(results: Sequence[Result], measure: str) -> Array:
    """A measure over results (n,); nan where it does not apply."""
    found = [r["measures"][measure] for r in results]
    return np.array([np.nan if v is None else v for v in found], dtype=float)


def difference(first: Sequence[Result], second: Sequence[Result], measure: str) -> Interval:
    """The mean of first less second, each pair on the same unit."""
    return mean_of(column(first, measure) - column(second, measure))


def completed(results: Sequence[Result]) -> Interval:
    """The share of sequences on which the target was never lost [%]."""
    return _percent(mean_of(column(results, "completed")))


def completed_more(first: Sequence[Result], second: Sequence[Result]) -> Interval:
    """The share that the first completes, less that of the second on the same sequences [%]."""
    return _percent(difference_of_shares(column(first, "completed"), column(second, "completed")))


def mean_percent(shares: Array) -> Interval:
    """The mean of shares (n,), each of one unit [%]."""
    return mean_of(100 * shares, least=0.0, most=100.0)


def _percent(share: Interval) -> Interval:
    return replace(share, value=100 * share.value, low=100 * share.low, high=100 * share.high)


def ratio(first: Array, second: Array) -> Interval:
    """The geometric mean of first over second (n,), each pair of the same unit."""
    log = mean_of(np.log(first / second))
    return Interval(*np.exp([log.value, log.low, log.high]).tolist())


def words(interval: Interval, unit: str = "") -> str:
    """Such as "2.1 px (1.9 to 2.4)"; without the ends where there is no interval."""
    value = f"{interval.value:.3g} {unit}".rstrip()
    if not interval.known:
        return value
    return f"{value} ({interval.low:.3g} to {interval.high:.3g})"


def mean(results: Sequence[Result], measure: str, unit: str = "") -> str:
    """The mean of a measure with its interval, in words."""
    return words(mean_of(column(results, measure)), unit)
