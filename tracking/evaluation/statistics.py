"""Is one tracker better than another? Paired tests, intervals, correction for many comparisons."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sim.types import Array


@dataclass(frozen=True, slots=True)
class McNemar:
    """Two methods on the same sequences: how often only one of them succeeded."""

    wins: int
    """Sequences on which only the first succeeded."""
    losses: int
    """Sequences on which only the second did."""
    ties: int = 0
    """Sequences on which both did, or neither; they do not enter the test."""

    @staticmethod
    def of(first: Array, second: Array) -> McNemar:
        """Of two scores (n,) for the same sequences, such as frames tracked: more is a success."""
        return McNemar(
            int(np.sum(first > second)), int(np.sum(first < second)), int(np.sum(first == second))
        )

    @property
    def z(self) -> float:
        """(|wins - losses| - 1) / sqrt(wins + losses), as Naeem, Pridmore and Mills have it."""
        discordant = self.wins + self.losses
        if discordant == 0:
            return 0.0
        return max(abs(self.wins - self.losses) - 1, 0) / float(np.sqrt(discordant))

    @property
    def p(self) -> float:
        """Exact two-sided probability of so uneven a split by chance (binomial)."""
        discordant = self.wins + self.losses
        if discordant == 0:
            return 1.0
        from scipy import stats  # takes a second

        return float(stats.binomtest(self.wins, discordant).pvalue)


@dataclass(frozen=True, slots=True)
class Interval:
    """A value and where it probably lies."""

    value: float
    low: float
    high: float


def bootstrap(
    scores: Array, rng: np.random.Generator, confidence: float = 0.95, draws: int = 10_000
) -> Interval:
    """The mean of scores (n,) with a percentile interval (Efron 1979).

    Raises:
        ValueError: There are no scores.
    """
    if len(scores) == 0:
        raise ValueError("an interval needs at least one score")
    chosen = rng.integers(0, len(scores), (draws, len(scores)))
    tail = 100 * (1 - confidence) / 2
    low, high = np.percentile(scores[chosen].mean(axis=1), [tail, 100 - tail])
    return Interval(float(scores.mean()), float(low), float(high))


def holm(p_values: Array) -> Array:
    """p values (n,) corrected for n comparisons (Holm 1979), in their own order."""
    order = np.argsort(p_values)
    count = len(p_values)
    corrected = np.empty(count)
    stepped = p_values[order] * (count - np.arange(count))
    corrected[order] = np.minimum(np.maximum.accumulate(stepped), 1.0)
    return corrected
