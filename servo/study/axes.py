"""The axes of a study, and what it draws: as values, and from TOML."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from servo.catalogue import PLUGINS
from servo.episode import stream
from servo.mistake import Mistake
from sim import plugins

SCENARIO = "scenario"
"""The axis of scenarios; all others have the names of settings."""
Value = Any
"""Of a setting, in the words that TOML has."""
SPANS = {"linspace": np.linspace, "geomspace": np.geomspace}
"""Axes that are given as [first, last, count]."""
LAWS = {"uniform": 2, "log_uniform": 2, "normal": 2, "choice": None}
"""How values are drawn, and how many numbers that takes."""
ELSEWHERE = {SCENARIO: "scenario", "run.seed": "seeds"}
"""Axes that a study has anyway: where their values belong."""
ALL = "*"
MOST_VALUES = 10_000


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
    for key, given in flat(table, {*SPANS, *LAWS}).items():
        at = f"{place}: axes.{key}"
        if key in ELSEWHERE:
            raise Mistake(f"{at}: list these under `{ELSEWHERE[key]}` instead")
        if isinstance(given, dict):
            law, numbers = _law(given, at)
            if law in LAWS:
                draws.append(Draw(key, law, numbers))
                continue
            given = _span(law, numbers, at)
        elif given == ALL and key.removesuffix(".kind") in PLUGINS and key.endswith(".kind"):
            given = plugins.kinds(PLUGINS[key.removesuffix(".kind")][0])
        if not isinstance(given, list) or not given:
            raise Mistake(f"{at} = {given!r}: an axis is a list of values, or a law for them")
        if len({repr(v) for v in given}) < len(given):
            raise Mistake(f"{at} has the same value twice")
        axes.append(Axis(key, tuple(given)))
    return tuple(axes), tuple(draws)


def _law(given: dict[str, Any], at: str) -> tuple[str, tuple[Any, ...]]:
    law, numbers = next(iter(given.items()))
    count = 3 if law in SPANS else LAWS[law]
    if len(given) > 1 or not isinstance(numbers, list) or len(numbers) != (count or len(numbers)):
        raise Mistake(f"{at}.{law}: this takes a list of {count or 'values'}")
    if law != "choice" and not all(finite(n) for n in numbers):
        raise Mistake(f"{at}.{law} = {numbers!r}: these should be finite numbers")
    if not numbers or (law in ("geomspace", "log_uniform") and min(numbers[:2]) <= 0):
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


def flat(table: dict[str, Any], ends: Iterable[str] = ()) -> dict[str, Any]:
    """Nested tables by dotted keys; a table with one of the keys in `ends` is a value."""
    found: dict[str, Any] = {}
    for key, value in table.items():
        if isinstance(value, dict) and value and not set(value) & set(ends):
            found |= {f"{key}.{inner}": v for inner, v in flat(value, ends).items()}
        else:
            found[key] = value
    return found


def finite(value: Any) -> bool:
    """Whether this is a number that one can reckon with."""
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
