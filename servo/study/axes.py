"""The axes of a study, which are settings with a list of values each, and its drawn settings, which
have a random distribution each.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from servo.mistake import Mistake, check_rules
from servo.scenario.catalogue import LISTS, PLUGINS
from servo.scenario.draws import LAWS, Draw, Value, flat, law_of
from servo.scenario.tables import SECTIONS
from servo.scenario.toml import Table, is_table
from tracking.trackers import general_kinds

SCENARIO = "scenario"
"""Name of the axis of scenarios; all other axes have the name of a setting or of [named]."""
Named = dict[str, dict[str, Table]]
"""Groups of settings by the name of their axis and their own name: the study's table [named]."""
SPANS = {"linspace": np.linspace, "geomspace": np.geomspace}
"""Functions that make an axis of [first, last, count]."""
COUNTS = {**dict.fromkeys(SPANS, 3), **LAWS}
"""Number of values in each form of an axis or a distribution; None: any number."""
ENDS = frozenset(COUNTS)
"""Keys of tables that are values of an axis, and not tables of settings."""
ELSEWHERE = {
    SCENARIO: "list these under `scenario` instead",
    "run.seed": "list these under `seeds` instead, or count them with --seeds",
    "run": "name one of its settings, such as run.latency",
    "expect": "bounds change nothing in a run; those of the study are under `expect`",
    "sweep": "a study changes the settings of runs only",
}
"""Keys that cannot be axes, and what the user should write instead."""
ALL = "*"
"""Value of an axis of kinds: all kinds that there are."""
MOST_VALUES = 10_000
"""Most values of an axis."""


@dataclass(frozen=True, slots=True)
class Axis:
    """A setting that a study varies, and the values that it takes: the study runs each of them."""

    key: str
    """Name of the setting, or of the axis in [named]."""
    values: tuple[Value, ...]


def axes_of(table: Table, place: str) -> tuple[tuple[Axis, ...], tuple[Draw, ...]]:
    """Return the axes and the drawn settings in a study's table [axes].

    A list of values, `{ linspace = [first, last, count] }` or "*" makes an axis; a distribution
    such as `{ uniform = [a, b] }` makes a drawn setting.

    Raises:
        Mistake: A setting or its values are wrong; the message begins with `place`.
    """
    axes: list[Axis] = []
    draws: list[Draw] = []
    for key, given in flat(table, f"{place}: axes", ENDS).items():
        at = f"{place}: axes.{key}"
        check_key(key, at)
        if is_table(given):
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
            forms = ", ".join(COUNTS)
            raise Mistake(f"{at} = {given!r}: expected a list of values, or one of {forms}")
        count = len(given)
        check_rules(
            (count > MOST_VALUES, f"{at} has {count:,} values; the limit is {MOST_VALUES:,}"),
            (_has_equal(given), f"{at} has the same value twice"),
        )
        axes.append(Axis(key, tuple(given)))
    return tuple(axes), tuple(draws)


def _has_equal(values: list[Any]) -> bool:
    """Return whether two of the values are equal; for Python True is 1, which is another value."""
    typed = [(isinstance(value, bool), value) for value in values]
    whole = [pair for pair in typed if not isinstance(pair[1], list | dict)]
    made = [pair for pair in typed if isinstance(pair[1], list | dict)]  # they have no hash
    return len(set(whole)) < len(whole) or any(pair in made[:at] for at, pair in enumerate(made))


def named_of(table: dict[str, dict[str, Table]], place: str) -> Named:
    """Return the groups of settings in a study's table [named]: settings by dotted key, by group
    and axis.

    Raises:
        Mistake: The name of an axis or a setting is wrong; the message begins with `place`.
    """
    found: Named = {}
    for axis, groups in table.items():
        at = f"{place}: named.{axis}"
        if axis in (*SECTIONS, *PLUGINS, *LISTS, SCENARIO, "seed"):
            raise Mistake(
                f"{at}: '{axis}' is reserved for a setting or section; give the axis another name"
            )
        found[axis] = {name: flat(group, f"{at}.{name}") for name, group in groups.items()}
        for name, group in found[axis].items():
            for key in group:
                check_key(key, f"{at}.{name}")
    return found


def check_key(key: str, at: str) -> None:
    """Check that a study can vary a setting or set it for all runs: run.seed and tables such as
    [expect] cannot. `at`, the setting's place in the study, begins the message.

    Raises:
        Mistake: It cannot; the message says what to write instead.
    """
    section = key.split(".")[0]
    remedy = ELSEWHERE.get(key) or (ELSEWHERE[section] if section in ("expect", "sweep") else None)
    if remedy is not None:
        raise Mistake(f"{at}: {remedy}")


def _span(law: str, numbers: tuple[Any, ...], at: str) -> list[float]:
    """Return the values of an axis from (first, last, count), equally spaced for "linspace" and in
    equal ratios for "geomspace"; `at` begins messages.
    """
    count = numbers[2]
    if not isinstance(count, int) or not 1 <= count <= MOST_VALUES:
        raise Mistake(
            f"{at}.{law}: the count is {count!r}; give a whole number from 1 to {MOST_VALUES:,}"
        )
    return SPANS[law](*numbers).tolist()


def check_apart(keys: Mapping[str, str], place: str) -> None:
    """Check that a study does not set a whole table and also a setting in it.

    Args:
        keys: Place of each setting in the study, by dotted key.
        place: The study's file, which begins the message.

    Raises:
        Mistake: It does.
    """
    for key, at in keys.items():
        names = key.split(".")
        for n in range(1, len(names)):
            whole = ".".join(names[:n])
            if whole in keys:
                raise Mistake(f"{place}: {at}: {keys[whole]} sets all of {whole} already")
