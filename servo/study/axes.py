"""The axes of a study, and what it draws: as values, and from TOML."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from servo.loop.episode import stream
from servo.mistake import Mistake
from servo.scenario.catalogue import PLUGINS
from servo.scenario.toml import is_number
from servo.study.keys import flat
from sim import kinds
from tracking.external import OF_THE_USER

SCENARIO = "scenario"
"""The axis of scenarios; all others have the names of settings."""
Value = Any
"""Of a setting, in the words that TOML has."""
SPANS = {"linspace": np.linspace, "geomspace": np.geomspace}
"""Axes that are given as [first, last, count]."""
LAWS = {"uniform": 2, "log_uniform": 2, "normal": 2, "choice": None}
"""How values are drawn, and how many numbers that takes."""
ENDS = frozenset({*SPANS, *LAWS})
"""A table with one of these is no table of settings."""
ELSEWHERE = {
    SCENARIO: "list these under `scenario` instead",
    "run.seed": "list these under `seeds` instead, or count them with --seeds",
    "run": "name one of its settings, such as run.latency",
    "expect": "bounds change nothing in a run; those of the study are under `expect`",
    "sweep": "a study changes the settings of runs only",
}
"""What cannot be an axis, and what to do instead."""
ALL = "*"
MOST_VALUES = 10_000
LARGEST = 1e100
"""Numbers in a law: sums and ratios of two have a floating-point value."""


@dataclass(frozen=True, slots=True)
class Axis:
    """A setting, and the values it takes one after the other."""

    key: str
    values: tuple[Value, ...]


@dataclass(frozen=True, slots=True)
class Draw:
    """A setting that is drawn anew for each seed: the same in all cells with this seed."""

    key: str
    law: str
    """uniform, log_uniform, normal or choice."""
    numbers: tuple[Value, ...]

    @property
    def ends(self) -> tuple[Value, ...]:
        """Values that stand for all that can be drawn: the ends of a range, a mean, all choices."""
        return self.numbers[:1] if self.law == "normal" else self.numbers

    def value(self, seed: int) -> Value:
        """What is drawn for a seed."""
        rng = stream(seed, f"draw {self.key}")
        match self.law:
            case "uniform":
                return float(rng.uniform(*self.numbers))
            case "log_uniform":
                return float(np.exp(rng.uniform(*np.log(self.numbers))))
            case "normal":
                return float(rng.normal(*self.numbers))
            case _:
                return self.numbers[int(rng.integers(len(self.numbers)))]


def axes_of(table: dict[str, Any], place: str) -> tuple[tuple[Axis, ...], tuple[Draw, ...]]:
    """What varies, from a table: a list makes an axis, `{ uniform = [a, b] }` draws.

    Raises:
        Mistake: Something is wrong in the table, whose file is `place`.
    """
    axes: list[Axis] = []
    draws: list[Draw] = []
    for key, given in flat(table, f"{place}: axes", ENDS).items():
        at = f"{place}: axes.{key}"
        check_key(key, at)
        if isinstance(given, dict):
            law, numbers = _law(given, at)
            if law in LAWS:
                draws.append(Draw(key, law, numbers))
                continue
            given = _span(law, numbers, at)
        elif given == ALL and key.removesuffix(".kind") in PLUGINS and key.endswith(".kind"):
            every = kinds.names(PLUGINS[key.removesuffix(".kind")][0])
            given = [kind for kind in every if kind not in OF_THE_USER]
        if not isinstance(given, list) or not given:
            raise Mistake(f"{at} = {given!r}: an axis is a list of values, or a law for them")
        if len(given) > MOST_VALUES:
            raise Mistake(f"{at} has {len(given):,} values; the limit is {MOST_VALUES:,}")
        if len({repr(_plain(v)) for v in given}) < len(given):
            raise Mistake(f"{at} has the same value twice")
        axes.append(Axis(key, tuple(given)))
    return tuple(axes), tuple(draws)


def check_key(key: str, at: str) -> None:
    """Refuse what cannot vary, or be set for all runs; `at` names its place.

    Raises:
        Mistake: It says where its values belong.
    """
    section = key.split(".")[0]
    remedy = ELSEWHERE.get(key) or (ELSEWHERE[section] if section in ("expect", "sweep") else None)
    if remedy is not None:
        raise Mistake(f"{at}: {remedy}")


def _plain(value: Value) -> Value:
    """A value in which numbers that are equal are the same: 1 and 1.0."""
    match value:
        case bool():
            return value
        case int() | float():
            return float(value) + 0.0  # -0.0 becomes 0.0
        case list():
            return [_plain(item) for item in value]
        case dict():
            return {key: _plain(value[key]) for key in sorted(value)}
        case _:
            return value


def _law(given: dict[str, Any], at: str) -> tuple[str, tuple[Any, ...]]:
    if len(given) != 1 or not ENDS.issuperset(given):
        laws = ", ".join([*SPANS, *LAWS])
        raise Mistake(f"{at} = {given!r}: an axis is a list of values, or one law: {laws}")
    law, numbers = next(iter(given.items()))
    count = 3 if law in SPANS else LAWS[law]
    if not isinstance(numbers, list) or not numbers or len(numbers) != (count or len(numbers)):
        raise Mistake(f"{at}.{law}: this takes a list of {count or 'values'}")
    if law == "choice":
        return law, tuple(numbers)
    if not all(is_number(n) for n in numbers):
        raise Mistake(f"{at}.{law} = {numbers!r}: these should be finite numbers")
    if max(abs(n) for n in numbers) > LARGEST:
        raise Mistake(f"{at}.{law} = {numbers!r}: these should be at most {LARGEST:g}")
    if law in ("geomspace", "log_uniform") and min(numbers[:2]) <= 0:
        raise Mistake(f"{at}.{law} = {numbers!r}: these should be above 0")
    if law in ("uniform", "log_uniform") and numbers[0] > numbers[1]:
        raise Mistake(f"{at}.{law} = {numbers!r}: the first should be the smaller one")
    if law == "normal" and numbers[1] < 0:
        raise Mistake(f"{at}.{law} = {numbers!r}: a standard deviation is not below 0")
    return law, tuple(numbers)


def _span(law: str, numbers: tuple[Any, ...], at: str) -> list[float]:
    count = numbers[2]
    if not isinstance(count, int) or not 1 <= count <= MOST_VALUES:
        raise Mistake(f"{at}.{law}: the count should be a whole number from 1 to {MOST_VALUES:,}")
    return SPANS[law](*numbers).tolist()
