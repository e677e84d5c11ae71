"""What a study is, as values: axes, draws, seeds, and the runs that they make."""

from __future__ import annotations

import copy
import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import tomli_w

from servo.loop.run_measures import check_expect
from servo.output.command_line import command_line
from servo.scenario import load as scenarios
from servo.scenario.load import Scenario, Table
from servo.scenario.override import assignment, put
from servo.study.axes import SCENARIO, Axis, Draw, Value


@dataclass(frozen=True, slots=True)
class Base:
    """A scenario that a study changes."""

    name: str
    """Shipped name, or path of a TOML file."""
    table: Table
    place: str
    """Its file, for messages."""


@dataclass(frozen=True, slots=True)
class Place:
    """One run's place in a study."""

    number: int
    """From 0."""
    base: Base
    seed: int
    settings: dict[str, Value]
    """Values of axes and draws, by key."""


@dataclass(frozen=True, slots=True)
class Run:
    """One run of a study: all that a worker needs; it is sent between processes."""

    number: int
    """Place in the study, from 0."""
    scenario: str
    seed: int
    settings: dict[str, Value]
    """Values of axes and draws, by key."""
    table: Table
    place: str
    pictured: bool
    """Whether a contact sheet is kept of it."""

    def parsed(self) -> Scenario:
        """Its scenario.

        Raises:
            Mistake: A setting does not fit.
        """
        scenario = scenarios.parse(self.table, self.scenario, self.place)
        check_expect(scenario)
        return scenario

    def command(self, changes: dict[str, Value]) -> str:
        """The command that runs it alone; changes are those of the whole study."""
        every = changes | {k: v for k, v in self.settings.items() if k != SCENARIO}
        sets = [f"{k}={_toml(v)}" for k, v in ordered(every).items()]
        return command_line("run", self.scenario, seed=self.seed, set=sets)


@dataclass(frozen=True, slots=True)
class Study:
    """A parsed study."""

    name: str
    title: str
    """A sentence about it."""
    table: Table
    """As it was read, the command line's changes included."""
    bases: tuple[Base, ...]
    changes: dict[str, Value]
    """Settings that all runs have in common."""
    axes: tuple[Axis, ...]
    draws: tuple[Draw, ...]
    seeds: tuple[int, ...]
    compare: str | None
    """The axis whose values are compared with each other."""
    expect: dict[str, float]
    """Bounds that every cell must keep."""

    @property
    def every_axis(self) -> tuple[Axis, ...]:
        """The axes, with that of the scenarios first where there are several."""
        several = Axis(SCENARIO, tuple(b.name for b in self.bases))
        return (several, *self.axes) if len(self.bases) > 1 else self.axes

    @property
    def size(self) -> int:
        """Number of runs."""
        cells = int(np.prod([len(a.values) for a in self.every_axis], dtype=object))
        return cells * len(self.seeds)

    def cells(self) -> Iterator[tuple[Base, dict[str, Value]]]:
        """Every combination of axis values."""
        for base in self.bases:
            named = {SCENARIO: base.name} if len(self.bases) > 1 else {}
            for values in itertools.product(*(a.values for a in self.axes)):
                yield base, named | dict(zip((a.key for a in self.axes), values, strict=True))

    def places(self) -> Iterator[Place]:
        """The places of all runs in their order: cell by cell, seed by seed."""
        numbers = itertools.count()
        for base, cell in self.cells():
            for seed in self.seeds:
                settings = cell | {d.key: d.value(seed) for d in self.draws}
                yield Place(next(numbers), base, seed, settings)

    def runs(self) -> Iterator[Run]:
        """All runs in their order."""
        return map(self._run, self.places())

    def samples(self) -> Iterator[Run]:
        """Few runs, not of the study, in which each value of an axis and each end of a draw occurs:
        one after the other, with the first values of all others.
        """
        varied = {a.key: a.values for a in self.axes} | {d.key: d.ends for d in self.draws}
        first = {key: values[0] for key, values in varied.items()}
        for base in self.bases:
            named = {SCENARIO: base.name} if len(self.bases) > 1 else {}
            yield self._run(Place(0, base, self.seeds[0], named | first))
            for key, values in varied.items():
                for value in values[1:]:
                    other = named | first | {key: value}
                    yield self._run(Place(0, base, self.seeds[0], other))

    def _run(self, place: Place) -> Run:
        base, seed, settings = place.base, place.seed, place.settings
        return Run(
            place.number, base.name, seed, settings, self._table(base, settings, seed), base.place,
            pictured=seed == self.seeds[0],
        )  # fmt: skip

    def _table(self, base: Base, settings: dict[str, Value], seed: int) -> Table:
        table = copy.deepcopy(base.table)
        table.pop("sweep", None)
        own = {k: v for k, v in settings.items() if k != SCENARIO}
        for key, value in ordered(self.changes | own).items():
            put(table, key, value, f"{self.name}.toml")
        put(table, "run.seed", seed, f"{self.name}.toml")
        return table


def ordered(settings: dict[str, Value]) -> dict[str, Value]:
    """Kinds and presets first: another kind clears the table that the other settings go to."""
    return dict(sorted(settings.items(), key=lambda item: not item[0].endswith(".kind")))


def _toml(value: Value) -> str:
    """A value as TOML in one line; a word that is no TOML needs no quotes after --set."""
    if isinstance(value, str) and assignment(f"key={value}") == ("key", value):
        return value
    # Inside two lists everything is written as a value, never as a table of its own.
    lines = tomli_w.dumps({"key": [[value]]}).strip().split("\n")
    return " ".join(line.strip() for line in lines).removeprefix("key = [ [ ")[: -len(", ], ]")]
