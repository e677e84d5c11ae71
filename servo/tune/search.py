"""The search for the best settings of a scenario: Optuna proposes them (tree-structured Parzen
estimator, Bergstra et al. 2011), and each race against the best on the same seeds ends early where
a paired test shows that it is lost (after Maron and Moore, The racing algorithm, 1997).
"""

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from importlib.util import find_spec
from itertools import islice, pairwise
from typing import Any

from servo.mistake import Mistake
from servo.scenario.draws import Draw
from servo.scenario.toml import Table
from servo.tune.aim import Aim, Values, column

MISSING = "Optuna is not installed: pip install 'servobench[tune]'"
GROUP = 4
"""Candidates that race at the same time: the more, the less each proposal learns from."""
RANDOM = 8
"""Candidates that are drawn at random before the first proposal."""
FIRST = 2
"""Seeds of a candidate before the first test; their number then doubles."""
INFEASIBLE = 1e9
"""Score told to Optuna of a candidate that breaks a condition; it uses their order only."""
Trial = tuple[Table, int]
"""Settings by dotted key, and a seed."""
Perform = Callable[[Sequence[Trial]], Sequence[Values]]
"""Function that does runs and returns their values, in the same order."""


@dataclass(slots=True)
class Candidate:
    """Settings that were tried, and the values of their runs, in the order of the seeds."""

    settings: Table
    """Values by dotted key; an empty table: the scenario as it is."""
    runs: list[Values] = field(default_factory=list[Values])
    trial: Any = None
    """Optuna's trial."""


@dataclass(frozen=True, slots=True)
class Found:
    """The candidates of a search in their order, of which the first is the scenario as it is; the
    best of those with all seeds; and the seeds that were used.
    """

    tried: list[Candidate]
    best: Candidate
    seeds: Sequence[int]


def check_budget(budget: int, seeds: int) -> None:
    """Check that Optuna is installed, and that the budget of runs is enough for a search.

    Raises:
        Mistake: Optuna is missing, or the budget is too small.
    """
    if find_spec("optuna") is None:
        raise Mistake(MISSING)
    least = seeds * (RANDOM // 2 + 1)
    if budget < least:
        raise Mistake(
            f"--budget {budget}: this is too small: with {seeds} seeds give at least {least} runs, "
            "for the settings as they are and four others"
        )


def search(
    aim: Aim,
    draws: Sequence[Draw],
    perform: Perform,
    seeds: Sequence[int],
    budget: int,
    whole: Callable[[Table], Table] = dict,
    integers: Sequence[str] = (),
) -> Found:
    """Search the best settings with at most `budget` runs; the same arguments give the same result.

    Args:
        aim: The measure and the conditions.
        draws: The settings with their ranges or values.
        perform: Function that does runs.
        seeds: The seeds of each candidate. If the first two runs of the scenario as it is are
            equal, only the first seed is used.
        budget: Largest number of runs.
        whole: Function that returns the settings of a candidate from the proposed values.
        integers: The settings whose values are whole numbers.
    """
    import optuna

    optuna.logging.set_verbosity(optuna.logging.ERROR)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what is experimental is fixed by our tests
        sampler = optuna.samplers.TPESampler(
            seed=0, n_startup_trials=RANDOM, multivariate=True, group=True, constant_liar=True
        )
    study = optuna.create_study(sampler=sampler)
    best = Candidate({})
    best.runs += perform([({}, seed) for seed in seeds[:FIRST]])
    if len(best.runs) == FIRST and best.runs[0] == best.runs[1]:
        seeds = seeds[:1]
        best.runs = best.runs[:1]
    best.runs += perform([({}, seed) for seed in seeds[FIRST:]])
    tried = [best]
    left = budget - len(best.runs)
    while left >= len(seeds):
        group = [Candidate({}, trial=study.ask()) for _ in range(min(GROUP, left // len(seeds)))]
        for one in group:
            one.settings = whole({d.key: _proposed(one.trial, d, integers) for d in draws})
        left -= _race(aim, group, best, perform, seeds)
        for one in group:
            study.tell(one.trial, _told(aim, one, best))
            if len(one.runs) == len(seeds) and aim.score(one.runs) < aim.score(best.runs):
                best = one
        tried += group
    return Found(tried, best, seeds)


def _race(
    aim: Aim,
    group: Sequence[Candidate],
    best: Candidate,
    perform: Perform,
    seeds: Sequence[int],
) -> int:
    """Do the runs of a group of candidates, seed by seed; one that is clearly worse than the best
    stops. Return the number of runs.
    """
    racing = list(group)
    count = len(seeds)
    ends = sorted({min(FIRST * 2**k, count) for k in range(count.bit_length() + 1)})
    for done, until in pairwise([0, *ends]):
        asked = [(one.settings, seed) for one in racing for seed in seeds[done:until]]
        runs = iter(perform(asked))
        for one in racing:
            one.runs += islice(runs, until - done)
        racing = [one for one in racing if not aim.is_worse(one.runs, best.runs)]
    return sum(len(one.runs) for one in group)


def _told(aim: Aim, one: Candidate, best: Candidate) -> float:
    """Return the score of a candidate as one number. One that has stopped is compared with the best
    on the seeds that both have.
    """
    score = aim.score(one.runs)
    if score.violation > 0:
        return INFEASIBLE * (1 + score.violation)
    if len(one.runs) == len(best.runs):
        return score.value
    every = column(best.runs, aim.minimise)
    return score.value + float(every.mean() - every[: len(one.runs)].mean())


def _proposed(trial: Any, draw: Draw, integers: Sequence[str]) -> object:
    """Return the value of a setting that Optuna proposes."""
    if draw.law == "choice":
        return draw.numbers[trial.suggest_categorical(draw.key, list(range(len(draw.numbers))))]
    low, high = draw.numbers
    is_log = draw.law == "log_uniform"
    if draw.key in integers:
        return trial.suggest_int(draw.key, int(low), int(high), log=is_log)
    return float(f"{trial.suggest_float(draw.key, low, high, log=is_log):.4g}")
