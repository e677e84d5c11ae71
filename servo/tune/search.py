"""The search for the best settings of a scenario: Optuna proposes them (tree-structured Parzen
estimator, Bergstra et al. 2011), and each races against the best on the same seeds; it stops where
a paired test shows that it is worse (after Maron and Moore 1997, The racing algorithm).
"""

import re
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.util import find_spec
from itertools import islice, pairwise
from typing import Any

import numpy as np

from servo.mistake import Mistake, check_known, check_rules
from servo.scenario.draws import Draw
from servo.scenario.expected import SUCCESS_RATE
from servo.scenario.toml import Table
from servo.study.run import Record
from servo.study.scenario_run import MEASURED, TIMES
from sim.types import Array

NAMES = (SUCCESS_RATE, *(name for name in MEASURED if name not in TIMES))
"""Names of what can be minimised or bounded: all measures but computing times, which differ when a
run is repeated."""
CONDITION = re.compile(r"\s*(\w+)\s*([<>]=)\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*")
MISSING = 10.0
"""Excess that counts for a run without a value, as a share of the bound."""
LOST = 1e9
"""Difference from the best that counts for a run without a value, in the measure's unit; and what
Optuna is told, times 1 + excess, of settings that break a condition."""
CERTAIN = 0.95
"""Confidence of the one-sided test that stops a candidate."""
GROUP = 4
"""Candidates that race at the same time: the more, the less each proposal has learned from."""
RANDOM = 8
"""Candidates that are drawn at random before the first proposal."""
FIRST = 2
"""Seeds of a candidate before its first test; their number then doubles."""

Values = Mapping[str, float]
"""The measures of a run by name, and `SUCCESS_RATE`, 1 or 0; nan or infinite without a value."""
Perform = Callable[[Sequence[tuple[Table, int]]], Sequence[Values]]
"""Function that does runs, of settings by dotted key with a seed, and returns their values."""


@dataclass(frozen=True, slots=True)
class Condition:
    """A bound on the mean of a measure over runs, such as "effort_rms_mm_s<=40"; `sign` is 1 for
    "at most" and -1 for "at least".
    """

    name: str
    sign: int
    """1: at most; -1: at least."""
    bound: float

    @staticmethod
    def read(text: str) -> "Condition":
        """Return the condition in a text MEASURE<=NUMBER or MEASURE>=NUMBER, such as
        "success_rate>=0.95".

        Raises:
            Mistake: The text has another form, or there is no such measure.
        """
        found = CONDITION.fullmatch(text)
        if found is None:
            raise Mistake(
                f"--keep {text}: this is no condition: write MEASURE<=NUMBER or MEASURE>=NUMBER, "
                'such as "success_rate>=0.95"'
            )
        check_known([found[1]], NAMES, f"--keep {text}", "measure")
        return Condition(found[1], 1 if found[2] == "<=" else -1, float(found[3]))

    def __str__(self) -> str:
        return f"{self.name}{'<=' if self.sign > 0 else '>='}{self.bound:g}"

    def excess(self, runs: Sequence[Values]) -> Array:
        """Return by how much each of n runs is beyond the bound (n,), as a share of the bound (of 1
        if it is 0): negative where a run keeps it, and 10 for a run without a finite value.

        Args:
            runs: Measures of each run by name.
        """
        values = column(runs, self.name)
        beyond = self.sign * (values - self.bound) / (abs(self.bound) or 1.0)
        return np.where(np.isfinite(values), beyond, MISSING)


@dataclass(frozen=True, slots=True)
class Aim:
    """What a search for settings is after: a measure to minimise, and conditions that the means of
    measures should keep.
    """

    minimise: str
    keep: tuple[Condition, ...]

    @staticmethod
    def read(minimise: str, keep: Sequence[str]) -> "Aim":
        """Return the aim that the options of a command line give.

        Args:
            minimise: Name of the measure.
            keep: Conditions, such as "success_rate>=0.95".

        Raises:
            Mistake: There is no such measure, or a condition has another form.
        """
        check_known([minimise], NAMES, "--minimise", "measure")
        return Aim(minimise, tuple(map(Condition.read, keep)))

    def score(self, runs: Sequence[Values]) -> tuple[float, float]:
        """Return (excess, mean) of runs with the same settings; of two such tuples the smaller one
        is better.

        The excess is the sum, over the conditions, of the mean of `Condition.excess` over the runs
        where this mean is above 0, plus 10 times the share of runs without a finite value of the
        minimised measure; it is 0 if all conditions are kept and no value is missing. The mean is
        that of the minimised measure, in its unit, over the runs that have it; infinite if none
        has.

        Args:
            runs: Measures of each run by name, of at least one run.
        """
        values = column(runs, self.minimise)
        finite = values[np.isfinite(values)]
        missing = MISSING * (1 - len(finite) / len(values))
        broken = sum(max(0.0, float(c.excess(runs).mean())) for c in self.keep)
        return missing + broken, float(finite.mean()) if len(finite) else np.inf

    def is_worse(self, runs: Sequence[Values], best: Sequence[Values]) -> bool:
        """Return True if settings are clearly worse than the best ones: a one-sided t test (95 %)
        finds that the measure is larger (paired by seed), or that the mean excess over a bound is
        above 0. Return False for fewer than two runs, and as long as the best settings break a
        condition themselves or lack a value of the measure in some run.

        Args:
            runs: Measures of the settings' runs with the first seeds.
            best: Measures of the best settings' runs with all seeds, in the same order of seeds.
        """
        if self.score(best)[0] > 0:
            return False
        paired = column(runs, self.minimise) - column(best[: len(runs)], self.minimise)
        excesses = [condition.excess(runs) for condition in self.keep]
        return any(map(_is_above_zero, (np.where(np.isfinite(paired), paired, LOST), *excesses)))


@dataclass(slots=True)
class Candidate:
    """Settings that a search tried, by dotted key (an empty table: the scenario as it is), and the
    measures of their runs, in the order of the seeds; a candidate that was stopped early has fewer
    runs. `trial` is Optuna's trial, None for the scenario as it is.
    """

    settings: Table
    runs: list[Values] = field(default_factory=list[Values])
    trial: Any = None


def values_of(record: Record | None) -> Values:
    """Return the measures of a run by name, with "success_rate" (1.0 or 0.0); for a run that failed
    (None), only a "success_rate" of 0.0.
    """
    if record is None:
        return {SUCCESS_RATE: 0.0}
    return {**record.measures, SUCCESS_RATE: float(record.success)}


def column(runs: Sequence[Values], name: str) -> Array:
    """Return the values (n,) of a measure in n runs, in its unit; nan where a run has none.

    Args:
        runs: Measures of each run by name.
        name: Name of the measure.
    """
    return np.array([run.get(name, np.nan) for run in runs], dtype=float)


def check_budget(budget: int, seeds: int) -> None:
    """Check that Optuna is installed, and that a budget of runs is enough for a search.

    Args:
        budget: Largest number of runs.
        seeds: Number of seeds of each candidate; five times as many runs are needed.

    Raises:
        Mistake: Optuna is missing, or the budget is too small.
    """
    least = seeds * (GROUP + 1)
    check_rules(
        (
            find_spec("optuna") is None,
            "tune needs Optuna, which is not installed: pip install 'servobench[tune]'",
        ),
        (
            budget < least,
            f"--budget {budget}: this is too small: with {seeds} seeds give at least {least} runs, "
            f"for the settings as they are and {GROUP} others",
        ),
    )


def search(
    aim: Aim,
    draws: Sequence[Draw],
    perform: Perform,
    seeds: Sequence[int],
    budget: int,
    finished: Callable[[Table], Table] = dict,
) -> tuple[list[Candidate], Candidate]:
    """Search the best settings of a scenario with at most `budget` runs; the same arguments give
    the same result.

    Args:
        aim: The measure to minimise and the conditions to keep.
        draws: The settings to search, each with its range or values.
        perform: Function that does runs, given pairs of settings (by dotted key) and a seed, and
            returns the measures of each by name.
        seeds: The seeds of each candidate. If the first two runs of the scenario as it is are
            equal, only the first seed is used.
        budget: Largest number of runs.
        finished: Function that returns the settings of a candidate from the proposed values, both
            by dotted key.

    Returns:
        All candidates in their order, of which the first is the scenario as it is, and the best
        one.
    """
    import optuna

    optuna.logging.set_verbosity(optuna.logging.ERROR)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # some of these options are new in Optuna
        sampler = optuna.samplers.TPESampler(
            seed=0, n_startup_trials=RANDOM, multivariate=True, group=True, constant_liar=True
        )
    study = optuna.create_study(sampler=sampler)
    best = Candidate({}, list(perform([({}, seed) for seed in seeds[:FIRST]])))
    untimed = [[run.get(name) for name in NAMES] for run in best.runs]
    seeds = seeds[:1] if str(untimed[0]) == str(untimed[-1]) else seeds
    best.runs = [*best.runs[: len(seeds)], *perform([({}, seed) for seed in seeds[FIRST:]])]
    tried = [best]
    left = budget - max(len(untimed), len(seeds))  # both first runs count
    while left >= len(seeds):
        group = [Candidate({}, trial=study.ask()) for _ in range(min(GROUP, left // len(seeds)))]
        for one in group:
            one.settings = finished({draw.key: _proposed(one.trial, draw) for draw in draws})
        _race(aim, group, best, perform, seeds)
        for one in group:
            left -= len(one.runs)
            study.tell(one.trial, _told(aim, one, best))
            if len(one.runs) == len(seeds) and aim.score(one.runs) < aim.score(best.runs):
                best = one
        tried += group
    return tried, best


def _race(
    aim: Aim, group: list[Candidate], best: Candidate, perform: Perform, seeds: Sequence[int]
) -> None:
    """Do the runs of a group of candidates with 2, 4, 8, ... seeds; after each of these, those that
    are clearly worse than the best stop.
    """
    count = len(seeds)
    ends = sorted({min(FIRST * 2**k, count) for k in range(count.bit_length() + 1)})
    for done, until in pairwise([0, *ends]):
        runs = iter(perform([(one.settings, s) for one in group for s in seeds[done:until]]))
        for one in group:
            one.runs += islice(runs, until - done)
        group = [one for one in group if not aim.is_worse(one.runs, best.runs)]


def _told(aim: Aim, one: Candidate, best: Candidate) -> float:
    """Return the score of a candidate as one number, of which Optuna uses the order. One that has
    stopped is compared with the best on the seeds that both have.
    """
    broken, value = aim.score(one.runs)
    if broken > 0:
        return LOST * (1 + broken)
    every = column(best.runs, aim.minimise)
    is_whole = len(one.runs) == len(every)
    return value if is_whole else value + float(every.mean() - every[: len(one.runs)].mean())


def _proposed(trial: Any, draw: Draw) -> object:
    """Return the value of a setting that Optuna proposes: one of the choices, or a number with four
    significant digits.
    """
    if draw.law == "choice":
        return draw.numbers[trial.suggest_categorical(draw.key, range(len(draw.numbers)))]
    value = trial.suggest_float(draw.key, *draw.numbers, log=draw.law == "log_uniform")
    return float(f"{value:.4g}")


def _is_above_zero(scores: Array) -> bool:
    """Return whether the mean of scores (n,) is above 0 by a one-sided t test with the confidence
    `CERTAIN`; False for fewer than two scores.
    """
    if len(scores) < FIRST:
        return False
    from scipy.special import stdtrit  # takes a second

    error = float(scores.std(ddof=1)) / len(scores) ** 0.5
    return float(scores.mean()) > max(0.0, float(stdtrit(len(scores) - 1, CERTAIN)) * error)
