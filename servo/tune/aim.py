"""The aim of a search for settings: a measure to minimise, and conditions to keep."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from servo.mistake import Mistake, check_known
from servo.scenario.expected import SUCCESS_RATE
from servo.study.run import Record
from servo.study.scenario_run import MEASURED, TIMES
from sim.types import Array

Values = Mapping[str, float]
"""The measures of a run by name, and `SUCCESS_RATE`, 1 or 0; nan or infinite without a value."""
NAMES = (SUCCESS_RATE, *(name for name in MEASURED if name not in TIMES))
"""What can be minimised or bounded: times differ when a run is repeated."""
CONDITION = re.compile(r"\s*(\w+)\s*(<=|>=)\s*([-+.\deE]+)\s*")
MISSING = 10.0
"""Excess of a run without a value, over the bound."""
CERTAIN = 0.95
"""Probability of a one-sided test that stops a candidate."""


@dataclass(frozen=True, slots=True)
class Condition:
    """A bound on the mean of a measure over runs, such as "effort_rms_mm_s<=40"."""

    name: str
    at_least: bool
    bound: float

    @staticmethod
    def read(text: str) -> "Condition":
        """Return the condition in a text such as "success_rate>=0.95".

        Raises:
            Mistake: The text has another form, or there is no such measure.
        """
        found = CONDITION.fullmatch(text)
        try:
            bound = float(found[3]) if found else np.nan
        except ValueError:
            bound = np.nan
        if found is None or not np.isfinite(bound):
            raise Mistake(
                f"--keep {text}: this is no condition: write MEASURE<=NUMBER or MEASURE>=NUMBER, "
                'such as "success_rate>=0.95"'
            )
        check_known([found[1]], NAMES, f"--keep {text}", "measure")
        return Condition(found[1], found[2] == ">=", bound)

    def __str__(self) -> str:
        return f"{self.name}{'>=' if self.at_least else '<='}{self.bound:g}"

    def excess(self, values: Array) -> Array:
        """Return by how much values (n,) are beyond the bound, over the bound; below 0 where they
        keep it.
        """
        beyond = (self.bound - values if self.at_least else values - self.bound) / (
            abs(self.bound) or 1.0
        )
        return np.where(np.isfinite(values), beyond, MISSING)


@dataclass(frozen=True, slots=True, order=True)
class Score:
    """The rank of settings: the smaller one is better, so that settings which keep all conditions
    are better than all others.
    """

    violation: float
    """Sum of the excesses of the conditions that are not kept; 0: all are kept."""
    value: float
    """Mean of the measure."""


@dataclass(frozen=True, slots=True)
class Aim:
    """A measure to minimise, and the conditions that the means of measures should keep."""

    minimise: str
    keep: tuple[Condition, ...]

    @staticmethod
    def read(minimise: str, keep: Sequence[str]) -> "Aim":
        """Return the aim of a command line; a text that is wrong raises a Mistake."""
        check_known([minimise], NAMES, "--minimise", "measure")
        return Aim(minimise, tuple(map(Condition.read, keep)))

    def score(self, runs: Sequence[Values]) -> Score:
        """Return the score of settings from their runs, one for each seed."""
        values = column(runs, self.minimise)
        finite = np.isfinite(values)
        violation = MISSING * float(np.mean(~finite))
        for condition in self.keep:
            violation += max(0.0, float(condition.excess(column(runs, condition.name)).mean()))
        return Score(violation, float(values[finite].mean()) if finite.any() else np.inf)

    def is_worse(self, runs: Sequence[Values], best: Sequence[Values]) -> bool:
        """Return whether settings are clearly worse than the best ones: by a paired one-sided t
        test of the measure, or because they break a condition by the same test of its values.

        Args:
            runs: Runs of the settings with the first seeds.
            best: Runs of the best settings with all seeds, in the same order.
        """
        if self.score(best).violation > 0:
            return False
        paired = column(runs, self.minimise) - column(best[: len(runs)], self.minimise)
        excesses = [c.excess(column(runs, c.name)) for c in self.keep]
        return any(map(_is_above_zero, (np.where(np.isfinite(paired), paired, np.inf), *excesses)))


def values_of(record: Record | None) -> Values:
    """Return the values of a run that an aim can use; of one that failed (None) only that it did
    not succeed.
    """
    if record is None:
        return {SUCCESS_RATE: 0.0}
    measures = {name: record.measures[name] for name in NAMES if name in record.measures}
    return {SUCCESS_RATE: float(record.success), **measures}


def column(runs: Sequence[Values], name: str) -> Array:
    """Return the values (n,) of a measure in n runs; nan where a run has none."""
    return np.array([run.get(name, np.nan) for run in runs], dtype=float)


def _is_above_zero(scores: Array) -> bool:
    """Return whether the mean of scores (n,) is above 0 with a probability of `CERTAIN`."""
    mean = float(scores.mean())
    if len(scores) < 2 or not mean > 0:
        return False
    if not np.isfinite(mean):
        return True
    from scipy.special import stdtrit  # takes a second

    error = float(scores.std(ddof=1)) / len(scores) ** 0.5
    return mean > float(stdtrit(len(scores) - 1, CERTAIN)) * error
