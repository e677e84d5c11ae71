"""Records of runs: those with something in common, their measures, differences and ratios."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from servo.study.record import Record
from sim.types import Array
from tracking.statistics.comparisons import Interval, difference_of_shares, mean_of


def group(records: Sequence[Record], **settings: Any) -> list[Record]:
    """Return the records with these settings."""
    return [r for r in records if all(r.settings[k] == value for k, value in settings.items())]


def column(records: Sequence[Record], measure: str) -> Array:
    """Return a measure over records (n,); nan where it does not apply."""
    return np.array([r.measures[measure] for r in records])


def done(records: Sequence[Record]) -> str:
    """Return how many completed, such as "3 of 4"."""
    return f"{int(column(records, 'completed').sum())} of {len(records)}"


def reads(records: Sequence[Record]) -> str:
    """Return the mean number of histograms read a frame."""
    return f"{column(records, 'evaluations').mean():.0f}"


def difference(first: Sequence[Record], second: Sequence[Record], measure: str) -> Interval:
    """Return the mean of first less second, each pair on the same unit."""
    return mean_of(column(first, measure) - column(second, measure))


def completed(records: Sequence[Record]) -> Interval:
    """Return the share of sequences on which the target was never lost [%]."""
    return _percent(mean_of(column(records, "completed")))


def completed_more(first: Sequence[Record], second: Sequence[Record]) -> Interval:
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


def mean(records: Sequence[Record], measure: str, unit: str = "") -> str:
    """Return the mean of a measure with its interval, in words."""
    return words(mean_of(column(records, measure)), unit)
