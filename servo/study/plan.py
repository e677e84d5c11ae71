"""A study as a value: its scenarios, axes, drawn settings and seeds, and the list of its runs.

An axis is a setting with a list of values, all of which are run, or a list of named groups of
settings; a drawn setting gets a random value for each seed.
"""

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from servo.mistake import Mistake, check_rules
from servo.scenario.catalogue import LISTS, PLUGINS
from servo.scenario.draws import LAWS, Draw, Value, flat, law_of
from servo.scenario.tables import SECTIONS
from servo.scenario.toml import Table, is_table
from servo.study.run import SCENARIO, Job
from servo.study.scenario_run import MEASURED, Named, StudiedScenario
from tracking.trackers import general_kinds

SPANS = {"linspace": np.linspace, "geomspace": np.geomspace}
"""Functions that make an axis of [first, last, count]."""
COUNTS = {**dict.fromkeys(SPANS, 3), **LAWS}
"""Number of values in each form of an axis or a distribution; None: any number."""
ENDS = frozenset(COUNTS)
"""Keys that mark a table in [axes] as the values or the distribution of one setting; other tables
contain settings."""
ELSEWHERE = {
    SCENARIO: "list these under `scenario` instead",
    "run.seed": "list these under `seeds` instead, or count them with --seeds",
    "run": "name one of its settings, such as run.latency",
    "expect": "bounds change nothing in a run; those of the study are under `expect`",
    "sweep": "a study changes the settings of runs only; leave this out",
}
"""Keys that cannot be axes, and what the user should write instead."""
ALL = "*"
"""Stands for all shipped scenarios, or, on an axis such as "tracker.kind", for all kinds that
`axes_of` allows."""
MOST_VALUES = 10_000
"""Most values of an axis."""


@dataclass(frozen=True, slots=True)
class Axis:
    """One axis of a study: the name of a setting, such as "tracker.kind", and its values, all of
    which the study runs. Instead, the name may be that of a table in [named], with the names of its
    groups of settings as values, or "scenario", with the names of scenarios as values.
    """

    key: str
    """Name of the setting, or of the axis in [named], or "scenario"."""
    values: tuple[Value, ...]


@dataclass(frozen=True, slots=True)
class Study:
    """A study: scenarios (`bases`) that are run with all combinations of the values of some
    settings (`axes`), for several seeds, with other settings (`draws`) drawn at random for each
    seed. `compare` is the axis whose values are compared with each other, `expect` has bounds on
    mean measures by name.
    """

    name: str
    title: str
    """A sentence that describes it."""
    table: Table
    """The table that was read, including the changes of the command line."""
    bases: tuple[StudiedScenario, ...]
    """The scenarios, with the settings of all runs."""
    axes: tuple[Axis, ...]
    """All axes except that of scenarios."""
    draws: tuple[Draw, ...]
    """Settings that are drawn for each seed."""
    seeds: tuple[int, ...]
    compare: str | None
    """The axis whose values are compared with each other; None: none."""
    expect: dict[str, float]
    """Upper bounds on the means of measures, and the least success_rate, which hold for each
    combination of axis values."""
    files: dict[str, str]
    """Digests of the files that the settings name, by path."""

    @property
    def every_axis(self) -> tuple[Axis, ...]:
        """Return all axes of the study; if it has several scenarios, the first one is the axis
        "scenario", with the scenarios' names as values.
        """
        several = Axis(SCENARIO, tuple(b.name for b in self.bases))
        return (several, *self.axes) if len(self.bases) > 1 else self.axes

    @property
    def keys(self) -> list[str]:
        """Return the names of all axes, such as "tracker.kind"; the first is "scenario" if the
        study has several scenarios.
        """
        return [axis.key for axis in self.every_axis]

    @property
    def size(self) -> int:
        """Return the number of runs of the study: all combinations of axis values, each with all
        seeds.
        """
        cells = int(np.prod([len(a.values) for a in self.every_axis], dtype=object))
        return cells * len(self.seeds)

    def cells(self) -> Iterator[tuple[StudiedScenario, dict[str, Value]]]:
        """Yield every combination of axis values (a cell): its scenario, and the values by name of
        the axis. These include the scenario's name, by "scenario", if the study has several.
        """
        for base in self.bases:
            named = {SCENARIO: base.name} if len(self.bases) > 1 else {}
            for values in itertools.product(*(a.values for a in self.axes)):
                yield base, named | dict(zip((a.key for a in self.axes), values, strict=True))

    def jobs(self) -> Iterator[Job]:
        """Yield all runs of the study as jobs, numbered from 0: all seeds of the first combination
        of axis values, then all seeds of the next one.
        """
        numbers = itertools.count()
        for base, cell in self.cells():
            for seed in self.seeds:
                settings = cell | {d.key: d.value(seed) for d in self.draws}
                yield self._job(next(numbers), base, seed, settings)

    def samples(self) -> Iterator[Job]:
        """Yield jobs with which the settings can be checked before the study is run, all with
        number 0 and the first seed.

        For each scenario, every value of an axis occurs in at least one job, and so do the ends of
        each range from which a setting is drawn (or the mean of a normal distribution, or all
        choices). The other settings of that job have the first of their values.
        """
        varied = {a.key: a.values for a in self.axes} | {d.key: d.ends for d in self.draws}
        first = {key: values[0] for key, values in varied.items()}
        for base in self.bases:
            named = {SCENARIO: base.name} if len(self.bases) > 1 else {}
            yield self._job(0, base, self.seeds[0], named | first)
            for key, values in varied.items():
                for value in values[1:]:
                    yield self._job(0, base, self.seeds[0], named | first | {key: value})

    def _job(
        self, number: int, base: StudiedScenario, seed: int, settings: dict[str, Value]
    ) -> Job:
        """Return a run of a scenario with its place in the study, seed, and values of axes and
        drawn settings.
        """
        command = base.command(seed, settings)
        return Job(number, base, seed, settings, command, pictured=seed == self.seeds[0])


def axes_of(table: Table, place: str) -> tuple[tuple[Axis, ...], tuple[Draw, ...]]:
    """Return the axes and the drawn settings in a study's table [axes].

    A list of values, `{ linspace = [first, last, count] }`, `{ geomspace = [first, last, count] }`
    or "*" makes an axis; a distribution such as `{ uniform = [a, b] }` makes a drawn setting. "*"
    is allowed for the kind of a component, such as "robot.kind" (but not for "disturbances" and
    "ground.kind"), and means all kinds; for "tracker.kind" it means those that can follow any
    target by pictures and the camera's motion alone, and need no program or model file of the user.

    Args:
        table: The table [axes], as read from TOML.
        place: The study's file, which begins messages.

    Raises:
        Mistake: A setting cannot be varied, or its values are wrong.
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
            (_has_equal(given), f"{at} has the same value twice: leave one out"),
        )
        axes.append(Axis(key, tuple(given)))
    return tuple(axes), tuple(draws)


def _has_equal(values: list[Any]) -> bool:
    """Return whether two of the values are equal. True and 1, which are equal in Python, count as
    different, but not inside lists and tables.
    """
    typed = [(isinstance(value, bool), value) for value in values]
    whole = [pair for pair in typed if not isinstance(pair[1], list | dict)]
    made = [pair for pair in typed if isinstance(pair[1], list | dict)]  # they have no hash
    return len(set(whole)) < len(whole) or any(pair in made[:at] for at, pair in enumerate(made))


OF_RESULTS = (SCENARIO, "seed", "repeats", "outcome", "success", "missed")
"""Columns of a study's results that are neither settings nor measures."""


def named_of(table: dict[str, dict[str, Table]], place: str) -> Named:
    """Return the groups of settings in a study's table [named], as {axis: {group: {key: value}}}
    with dotted keys, such as "tracker.kind".

    Args:
        table: The table [named], as read from TOML.
        place: The study's file, which begins messages.

    Raises:
        Mistake: An axis has the name of a section of scenarios, "scenario" or "seed", or a group
            has a setting twice, or one that a study cannot vary.
    """
    found: Named = {}
    for axis, groups in table.items():
        at = f"{place}: named.{axis}"
        if axis in (*SECTIONS, *PLUGINS, *LISTS, *OF_RESULTS, *MEASURED) or "." in axis:
            raise Mistake(
                f"{at}: '{axis}' is reserved for a setting, a section or a result; give the axis "
                "another name"
            )
        found[axis] = {name: flat(group, f"{at}.{name}") for name, group in groups.items()}
        for name, group in found[axis].items():
            for key in group:
                check_key(key, f"{at}.{name}")
    return found


def check_key(key: str, at: str) -> None:
    """Check that a study may vary a setting, or set it for all runs. `scenario`, "run" as a whole,
    "run.seed", and settings in [expect] and [sweep] are not allowed.

    Args:
        key: The setting, such as "run.latency".
        at: Place of the setting in the study, which begins the message.

    Raises:
        Mistake: The setting is not allowed; the message says what to write instead.
    """
    section = key.split(".")[0]
    remedy = ELSEWHERE.get(key) or (ELSEWHERE[section] if section in ("expect", "sweep") else None)
    if remedy is not None:
        raise Mistake(f"{at}: {remedy}")


def _span(law: str, numbers: tuple[Any, ...], at: str) -> list[float]:
    """Return the values of an axis from (first, last, count), equally spaced for "linspace" and in
    equal ratios for "geomspace"; `at` begins messages.

    Raises:
        Mistake: The count is not a whole number from 1 to `MOST_VALUES`.
    """
    count = numbers[2]
    if not isinstance(count, int) or not 1 <= count <= MOST_VALUES:
        raise Mistake(
            f"{at}.{law}: the count is {count!r}; give a whole number from 1 to {MOST_VALUES:,}"
        )
    return SPANS[law](*numbers).tolist()


def check_apart(keys: Mapping[str, str], place: str) -> None:
    """Check that a study does not set a whole table, such as "tracker", and also a setting in it,
    such as "tracker.kind".

    Args:
        keys: Where each setting or table stands in the study, such as "set.tracker", by dotted key.
        place: The study's file, which begins the message.

    Raises:
        Mistake: A table and a setting in it are both set.
    """
    for key, at in keys.items():
        names = key.split(".")
        for n in range(1, len(names)):
            whole = ".".join(names[:n])
            if whole in keys:
                raise Mistake(
                    f"{place}: {at}: {keys[whole]} sets all of {whole} already: leave "
                    "one of them out"
                )
