"""Statistics of comparisons: McNemar's test, bootstrap intervals, and Holm's correction."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Le

from sim.types import Array

DRAWS = 2000
"""Number of the bootstrap's resamples."""
Count = Annotated[int, Ge(0), Le(1 << 53)]


@dataclass(frozen=True, slots=True)
class McNemar:
    """McNemar's test of two methods on the same sequences, by how often only one succeeded."""

    wins: Count
    """Number of sequences on which only the first succeeded."""
    losses: Count
    """Number of sequences on which only the second succeeded."""
    ties: Count = 0
    """Number of sequences on which both or neither succeeded; the test does not use them."""

    @staticmethod
    def of(first: Array, second: Array) -> McNemar:
        """The test of two scores (n,) for the same sequences; the higher score is a success."""
        return McNemar(
            int(np.sum(first > second)), int(np.sum(first < second)), int(np.sum(first == second))
        )

    @property
    def z(self) -> float:
        """(|wins - losses| - 1) / sqrt(wins + losses) (Naeem, Pridmore, Mills: the KAMS paper)."""
        discordant = self.wins + self.losses
        if discordant == 0:
            return 0.0
        return max(abs(self.wins - self.losses) - 1, 0) / float(np.sqrt(discordant))

    @property
    def p(self) -> float:
        """Exact two-sided p value (binomial)."""
        discordant = self.wins + self.losses
        if discordant == 0:
            return 1.0
        from scipy import stats  # takes a second

        return float(stats.binomtest(self.wins, discordant).pvalue)


@dataclass(frozen=True, slots=True)
class Interval:
    """A value with a confidence interval."""

    value: float
    low: float
    high: float


def bootstrap(scores: Array, seed: int = 0, confidence: float = 0.95) -> Interval:
    """The mean of scores (n,) with a percentile interval (Efron, Bootstrap methods, 1979).

    The same scores and seed give the same interval. The interval of a single score is its value.

    Raises:
        ValueError: There are no scores.
    """
    if len(scores) == 0:
        raise ValueError("an interval needs at least one score")
    mean = float(scores.mean())
    if len(scores) == 1 or not np.isfinite(scores).all():
        return Interval(mean, mean, mean)
    from scipy import stats  # takes a second

    low, high = stats.bootstrap(
        (scores,), np.mean, method="percentile", n_resamples=DRAWS, confidence_level=confidence,
        rng=np.random.default_rng(seed),
    ).confidence_interval  # fmt: skip
    return Interval(mean, float(low), float(high))


def titles(names: Iterable[str]) -> list[str]:
    """Titles of the columns of intervals in a table: NAME, NAME_low and NAME_high for each."""
    return [f"{name}{end}" for name in names for end in ("", "_low", "_high")]


def cells(intervals: Iterable[Interval | None]) -> list[float | str]:
    """Cells of intervals under `titles`; empty for None."""
    found = [("", "", "") if i is None else (i.value, i.low, i.high) for i in intervals]
    return [cell for three in found for cell in three]


def holm(p_values: Array) -> Array:
    """p values (n,) corrected for n comparisons (Holm 1979), in the given order."""
    order = np.argsort(p_values)
    count = len(p_values)
    corrected = np.empty(count)
    stepped = p_values[order] * (count - np.arange(count))
    corrected[order] = np.minimum(np.maximum.accumulate(stepped), 1.0)
    return corrected
