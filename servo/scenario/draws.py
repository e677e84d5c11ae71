"""Settings that are drawn at random for each seed, by a scenario's table [vary].

[vary] gives the distribution of some settings, such as `start.x = { uniform = [-5, 5] }`. Seed 0
runs the scenario as it is written; each other seed draws these settings anew, so that runs differ
even for a tracker without random numbers.
"""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from servo.loop.settings import stream
from servo.mistake import Mistake, check_rules
from servo.scenario.toml import Table, is_number, is_table, names_of

Value = object
"""Value of a setting, in the types of TOML."""
LAWS: dict[str, int | None] = {"uniform": 2, "log_uniform": 2, "normal": 2, "choice": None}
"""Distributions, and the number of values that describe each; None: any number."""
LARGEST_NUMBER = 1e100
"""Largest number in a distribution: sums and ratios of two such numbers are finite."""
AS_WRITTEN = 0
"""The seed that runs a scenario as it is written, without drawn settings."""
GROUND = "ground.kind"
"""The only `kind` that can be drawn: it names a picture, not a component with its own settings."""
FIXED = ("run.seed", "expect", "vary", "sweep", "measure")
"""Settings and tables that cannot be drawn."""


@dataclass(frozen=True, slots=True)
class Draw:
    """A setting of a scenario, such as "start.x", and the distribution from which its value is
    drawn for each seed: the distribution's name, and its parameters or choices.
    """

    key: str
    """Name of the setting, such as "start.x"."""
    law: str
    """uniform, log_uniform, normal or choice."""
    numbers: tuple[Any, ...]
    """Ends of the range, mean and standard deviation, or the choices."""

    @property
    def ends(self) -> tuple[Value, ...]:
        """Values of the setting that are checked before a run: both ends of the range of a uniform
        or log-uniform distribution, the mean of a normal one, or all choices.
        """
        return self.numbers[:1] if self.law == "normal" else self.numbers

    def value(self, seed: int) -> Value:
        """Return the value of the setting that is drawn for the seed of a run; the same seed gives
        the same value.
        """
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


def draws_of(table: object, place: str) -> tuple[Draw, ...]:
    """Return the settings of a scenario that are drawn at random, with their distributions, in the
    order of its table [vary].

    Args:
        table: The table [vary], such as {"start.x": {"uniform": [-5, 5]}}.
        place: Where the table comes from; it begins messages.

    Raises:
        Mistake: A setting cannot be drawn, or a distribution is wrong. Whether the setting exists
            is not checked.
    """
    if not is_table(table):
        raise Mistake(f"{place} should be a table of settings and distributions, not {table!r}")
    found = list[Draw]()
    for key, given in flat(table, place, LAWS).items():
        at = f"{place}.{key}"
        if given == {}:  # --set fixed each setting in it
            continue
        if (key.endswith(".kind") and key != GROUND) or any(
            key == f or key.startswith(f"{f}.") for f in FIXED
        ):
            raise Mistake(
                f"{at}: this setting cannot be drawn at random; draw another one, such as start.x"
            )
        if not is_table(given):
            raise Mistake(
                f"{at} = {given!r}: expected a distribution, such as {{ uniform = [-5, 5] }}"
            )
        found.append(Draw(key, *law_of(given, at, LAWS)))
    return tuple(found)


def law_of(given: Table, at: str, counts: Mapping[str, int | None]) -> tuple[str, tuple[Any, ...]]:
    """Return the name and the parameters of the distribution that a table describes: "uniform" and
    (0, 1) for { uniform = [0, 1] }. A study's axis, such as { linspace = [0, 1, 5] }, is read in
    the same way.

    Args:
        given: The table.
        at: Where the table comes from; it begins messages.
        counts: Number of parameters by name, for each distribution or form of an axis that is
            allowed; None: any number.

    Raises:
        Mistake: The table does not name exactly one distribution of `counts`, or its parameters are
            wrong.
    """
    if len(given) != 1 or not given.keys() <= counts.keys():
        raise Mistake(
            f"{at} = {given!r}: expected one distribution with its numbers, one of "
            f"{', '.join(counts)}"
        )
    law, numbers = next(iter(given.items()))
    count = counts[law]
    if not isinstance(numbers, list) or not numbers or len(numbers) != (count or len(numbers)):
        what = f"{count} numbers" if count else "at least one value"
        raise Mistake(f"{at}.{law} = {numbers!r}: expected a list of {what}")
    if law == "choice":
        return law, tuple(numbers)
    if not all(is_number(n) for n in numbers):
        raise Mistake(f"{at}.{law} = {numbers!r}: one of these is not a finite number")
    place = f"{at}.{law} = {numbers!r}"
    largest = max(abs(n) for n in numbers)
    first, second = numbers[:2]
    check_rules(
        (largest > LARGEST_NUMBER, f"{place}: a number is above {LARGEST_NUMBER:g}"),
        (
            law in ("geomspace", "log_uniform") and min(first, second) <= 0,
            f"{place}: a number is not above 0",
        ),
        (
            law in ("uniform", "log_uniform") and first > second,
            f"{place}: the first number is larger than the second",
        ),
        (law == "normal" and second < 0, f"{place}: the standard deviation is below 0"),
    )
    return law, tuple(numbers)


def flat(table: Mapping[str, object], place: str, ends: Collection[str] = ()) -> Table:
    """Return the values of nested tables as one table with dotted keys such as "run.latency",
    without spaces around the dots; a name that contains a dot is in quotes.

    Args:
        table: The outer table, which is not changed.
        place: Where the table comes from; it begins messages.
        ends: Keys, such as "uniform": a table that has one of them is a value, and so is an empty
            table.

    Raises:
        Mistake: A key is given twice, also in different spellings, or has an empty name.
    """
    found: Table = {}
    for key, value in leaves(table, ends):
        names = names_of(key)
        name = ".".join(f'"{part}"' if "." in part else part for part in names)
        check_rules(
            (
                not all(names),
                f"{place}: '{key}' is not the name of a setting, such as run.latency",
            ),
            (name in found, f"{place}: {name} is given twice"),
        )
        found[name] = value
    return found


def leaves(table: Mapping[str, object], ends: Collection[str] = ()) -> Iterable[tuple[str, object]]:
    """Yield the dotted key and the value of each setting in nested tables. A table that has a key
    from `ends`, such as "uniform", is one value, and so is an empty table. The same dotted key is
    yielded twice if the tables spell it in two ways.
    """
    for key, value in table.items():
        if is_table(value) and value and value.keys().isdisjoint(ends):
            yield from ((f"{key}.{inner}", v) for inner, v in leaves(value, ends))
        else:
            yield key, value
