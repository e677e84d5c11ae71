"""Settings that are drawn for each seed.

A scenario's `[vary]` table names settings and the law that each is drawn from. Seed 0 is the
scenario as it is written; each other seed is another run of the same experiment, also for a tracker
without random numbers.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from servo.loop.settings import stream
from servo.mistake import Mistake
from servo.scenario.toml import Table, is_number, names_of

Value = Any
"""Value of a setting, in the types of TOML."""
LAWS: dict[str, int | None] = {"uniform": 2, "log_uniform": 2, "normal": 2, "choice": None}
"""Laws of random values, and how many numbers each takes; None: any number."""
LARGEST_NUMBER = 1e100
"""Largest number in a law: sums and ratios of two such numbers are finite."""
AS_WRITTEN = 0
"""The seed for which a scenario's own draws are left out."""
GROUND = "ground.kind"
"""A kind that is drawn: it names a picture, not a part with settings of its own."""
FIXED = ("run.seed", "expect", "vary", "sweep", "measure")
"""Settings that a scenario does not draw."""


@dataclass(frozen=True, slots=True)
class Draw:
    """A setting that is drawn for each seed: the same value in all runs of that seed."""

    key: str
    law: str
    """uniform, log_uniform, normal or choice."""
    numbers: tuple[Value, ...]

    @property
    def ends(self) -> tuple[Value, ...]:
        """Return the values to check: the ends of a range, a mean, or all choices."""
        return self.numbers[:1] if self.law == "normal" else self.numbers

    def value(self, seed: int) -> Value:
        """Return the value for a seed."""
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


def draws_of(table: Any, place: str) -> tuple[Draw, ...]:
    """Return the draws of a scenario, from its `[vary]` table.

    Raises:
        Mistake: A setting or a law is wrong; the message begins with `place`.
    """
    if not isinstance(table, dict):
        raise Mistake(f"{place} should be a table of settings and laws, not {table!r}")
    found = list[Draw]()
    for key, given in flat(table, place, LAWS).items():
        at = f"{place}.{key}"
        if given == {}:  # all of it was set
            continue
        if (key.endswith(".kind") and key != GROUND) or any(
            key == f or key.startswith(f"{f}.") for f in FIXED
        ):
            raise Mistake(f"{at}: this is not drawn; draw a setting, such as start.x")
        if not isinstance(given, dict):
            raise Mistake(f"{at} = {given!r}: expected a law, such as {{ uniform = [-5, 5] }}")
        found.append(Draw(key, *law_of(given, at, LAWS)))
    return tuple(found)


def law_of(given: Table, at: str, counts: Mapping[str, int | None]) -> tuple[str, tuple[Any, ...]]:
    """Return law and numbers of a table such as { uniform = [0, 1] }.

    Args:
        given: The table.
        at: Its place, for messages.
        counts: The laws that may stand there, and how many numbers each takes; None: any number.

    Raises:
        Mistake: The law is not among `counts`, or its numbers are wrong.
    """
    if len(given) != 1 or not given.keys() <= counts.keys():
        raise Mistake(f"{at} = {given!r}: expected one law: {', '.join(counts)}")
    law, numbers = next(iter(given.items()))
    count = counts[law]
    if not isinstance(numbers, list) or not numbers or len(numbers) != (count or len(numbers)):
        raise Mistake(f"{at}.{law}: this takes a list of {count or 'values'}")
    if law == "choice":
        return law, tuple(numbers)
    if not all(is_number(n) for n in numbers):
        raise Mistake(f"{at}.{law} = {numbers!r}: these should be finite numbers")
    if max(abs(n) for n in numbers) > LARGEST_NUMBER:
        raise Mistake(f"{at}.{law} = {numbers!r}: these should be at most {LARGEST_NUMBER:g}")
    if law in ("geomspace", "log_uniform") and min(numbers[:2]) <= 0:
        raise Mistake(f"{at}.{law} = {numbers!r}: these should be above 0")
    if law in ("uniform", "log_uniform") and numbers[0] > numbers[1]:
        raise Mistake(f"{at}.{law} = {numbers!r}: the first should be the smaller one")
    if law == "normal" and numbers[1] < 0:
        raise Mistake(f"{at}.{law} = {numbers!r}: a standard deviation is not below 0")
    return law, tuple(numbers)


def spelled(key: str, place: str) -> str:
    """Return a dotted key without the spaces around its names.

    Raises:
        Mistake: One of its names is empty; the message begins with `place`.
    """
    names = names_of(key)
    if not all(names):
        raise Mistake(f"{place}: '{key}' is not the name of a setting, such as run.latency")
    return ".".join(f'"{name}"' if "." in name else name for name in names)


def flat(table: Mapping[str, Any], place: str, ends: Iterable[str] = ()) -> Table:
    """Return the values of nested tables by dotted keys; an empty table, or one with a key from
    `ends`, is a value.

    Raises:
        Mistake: A key is given twice, also in different spellings, or has an empty name.
    """
    found: Table = {}
    for key, value in _leaves(table, frozenset(ends)):
        name = spelled(key, place)
        if name in found:
            raise Mistake(f"{place}: {name} is given twice")
        found[name] = value
    return found


def _leaves(table: Mapping[str, Any], ends: frozenset[str]) -> Iterable[tuple[str, Any]]:
    for key, value in table.items():
        if isinstance(value, dict) and value and ends.isdisjoint(value):
            yield from ((f"{key}.{inner}", v) for inner, v in _leaves(value, ends))
        else:
            yield key, value
