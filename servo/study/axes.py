"""Axes and draws of a study, as values and from TOML."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from servo.mistake import Mistake
from servo.scenario.catalogue import LISTS, PLUGINS
from servo.scenario.draws import LAWS, Draw, Value, flat, law_of
from servo.scenario.tables import SECTIONS
from servo.scenario.toml import Table
from tracking.trackers import general_kinds

SCENARIO = "scenario"
"""Key of the axis of scenarios; the keys of all others are settings."""
Named = dict[str, dict[str, dict[str, Value]]]
"""Groups of settings, by the name of their axis and their own."""
SPANS = {"linspace": np.linspace, "geomspace": np.geomspace}
"""Axes that are given as [first, last, count]."""
COUNTS = {**dict.fromkeys(SPANS, 3), **LAWS}
"""How many numbers each law of an axis takes; None: any number."""
ENDS = frozenset(COUNTS)
"""A table with one of these keys is a value, not a table of settings."""
ELSEWHERE = {
    SCENARIO: "list these under `scenario` instead",
    "run.seed": "list these under `seeds` instead, or count them with --seeds",
    "run": "name one of its settings, such as run.latency",
    "expect": "bounds change nothing in a run; those of the study are under `expect`",
    "sweep": "a study changes the settings of runs only",
}
"""Keys that cannot be axes, and what to do instead."""
ALL = "*"
MOST_VALUES = 10_000


@dataclass(frozen=True, slots=True)
class Axis:
    """A setting and the values that it takes in turn."""

    key: str
    values: tuple[Value, ...]


def axes_of(table: Table, place: str) -> tuple[tuple[Axis, ...], tuple[Draw, ...]]:
    """Return axes and draws from a table: a list is an axis, `{ uniform = [a, b] }` is a draw.

    Raises:
        Mistake: Something is wrong in the table; `place` names its file.
    """
    axes: list[Axis] = []
    draws: list[Draw] = []
    for key, given in flat(table, f"{place}: axes", ENDS).items():
        at = f"{place}: axes.{key}"
        check_key(key, at)
        if isinstance(given, dict):
            law, numbers = law_of(given, at, COUNTS)
            if law in LAWS:
                draws.append(Draw(key, law, numbers))
                continue
            given = _span(law, numbers, at)
        elif given == ALL and key == "tracker.kind":
            given = general_kinds()
        elif given == ALL and key.removesuffix(".kind") in PLUGINS and key.endswith(".kind"):
            given = PLUGINS[key.removesuffix(".kind")][0].names()
        if not isinstance(given, list) or not given:
            raise Mistake(f"{at} = {given!r}: an axis is a list of values, or a law for them")
        if len(given) > MOST_VALUES:
            raise Mistake(f"{at} has {len(given):,} values; the limit is {MOST_VALUES:,}")
        if len({repr(_plain(v)) for v in given}) < len(given):
            raise Mistake(f"{at} has the same value twice")
        axes.append(Axis(key, tuple(given)))
    return tuple(axes), tuple(draws)


def named_of(table: dict[str, dict[str, Table]], place: str) -> Named:
    """Return the axes whose values are named groups of settings.

    Raises:
        Mistake: Something is wrong in the table; `place` names its file.
    """
    found: Named = {}
    for axis, groups in table.items():
        at = f"{place}: named.{axis}"
        if axis in (*SECTIONS, *PLUGINS, *LISTS, SCENARIO, "seed"):
            raise Mistake(f"{at}: '{axis}' is a section; give the axis another name")
        found[axis] = {name: flat(group, f"{at}.{name}") for name, group in groups.items()}
        for name, group in found[axis].items():
            for key in group:
                check_key(key, f"{at}.{name}")
    return found


def check_key(key: str, at: str) -> None:
    """Refuse a key that can neither vary nor be set for all runs; `at` names its place.

    Raises:
        Mistake: The message says where its values belong.
    """
    section = key.split(".")[0]
    remedy = ELSEWHERE.get(key) or (ELSEWHERE[section] if section in ("expect", "sweep") else None)
    if remedy is not None:
        raise Mistake(f"{at}: {remedy}")


def _plain(value: Value) -> Value:
    """Return a value with all numbers as floats, so that 1 and 1.0 are equal as text."""
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


def _span(law: str, numbers: tuple[Any, ...], at: str) -> list[float]:
    count = numbers[2]
    if not isinstance(count, int) or not 1 <= count <= MOST_VALUES:
        raise Mistake(f"{at}.{law}: the count should be a whole number from 1 to {MOST_VALUES:,}")
    return SPANS[law](*numbers).tolist()


def check_apart(keys: Mapping[str, str], place: str) -> None:
    """Refuse a key inside a table that another key sets as a whole.

    Args:
        keys: The place of each key in the study, by key.
        place: The study's file.

    Raises:
        Mistake: There are such keys.
    """
    for key, at in keys.items():
        names = key.split(".")
        for n in range(1, len(names)):
            whole = ".".join(names[:n])
            if whole in keys:
                raise Mistake(f"{place}: {at}: {keys[whole]} sets all of {whole} already")
