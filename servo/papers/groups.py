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
    """Return the results with these values."""
    return [r for r in results if all(r[key] == value for key, value in wanted.items())]


def column(results: Sequence[Result], measure: str) -> Array:
    """Return a measure over results (n,); nan where it does not apply."""
    found = [r["measures"][measure] for r in results]
    return np.array([np.nan if v is None else v for v in found], dtype=float)


def done(results: Sequence[Result]) -> str:
    """Return how many completed, such as "3 of 4"."""
    return f"{int(column(results, 'completed').sum())} of {len(results)}"


def reads(results: Sequence[Result]) -> str:
    """Return the mean number of histograms read a frame."""
    return f"{column(results, 'evaluations').mean():.0f}"


def difference(first: Sequence[Result], second: Sequence[Result], measure: str) -> Interval:
    """Return the mean of first less second, each pair on the same unit."""
    return mean_of(column(first, measure) - column(second, measure))


def completed(results: Sequence[Result]) -> Interval:
    """Return the share of sequences on which the target was never lost [%]."""
    return _percent(mean_of(column(results, "completed")))


def completed_more(first: Sequence[Result], second: Sequence[Result]) -> Interval:
    """Return how many more the first completes than the second on the same sequences [%]."""
    return _percent(difference_of_shares(column(first, "completed"), column(second, "completed")))


def mean_percent(shares: Array) -> Interval:
    """Return the mean of shares (n,), each of one unit [%]."""
    return mean_of(100 * shares, least=0.0, most=100.0)


def _percent(share: Interval) -> Interval:
    return replace(share, value=100 * share.value, low=100 * share.low, high=100 * share.high)


def ratio(first: Array, second: Array) -> Interval:
    """Return the geometric mean of first over second (n,), each pair of the same unit."""
    log = mean_of(np.log(first / second))
    return Interval(*np.exp([log.value, log.low, log.high]).tolist())


def words(interval: Interval, unit: str = "") -> str:
    """Return text such as "2.1 px (1.9 to 2.4)"; without the ends where there is no interval."""
    value = f"{interval.value:.3g} {unit}".rstrip()
    if not interval.known:
        return value
    return f"{value} ({interval.low:.3g} to {interval.high:.3g})"


def mean(results: Sequence[Result], measure: str, unit: str = "") -> str:
    """Return the mean of a measure with its interval, in words."""
    return words(mean_of(column(results, measure)), unit)
