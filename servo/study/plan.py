"""A study as values: axes, draws and seeds, the runs that result from them, and its files."""

from __future__ import annotations

import copy
import itertools
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
import tomli_w

from servo.loop.check_expect import check_expect
from servo.output.formats import Document, Made, Number, command_line
from servo.output.versions import versions
from servo.scenario import load as scenarios
from servo.scenario.draws import Draw, Value
from servo.scenario.load import Scenario, Table
from servo.scenario.toml import assignment, put
from servo.study.axes import SCENARIO, Axis, Named


@dataclass(frozen=True, slots=True)
class Base:
    """A scenario that a study changes."""

    name: str
    """Shipped name, or path of a TOML file."""
    table: Table
    place: str
    """Its file, for messages."""


@dataclass(frozen=True, slots=True)
class Run:
    """One run of a study, with all that a worker needs; it is sent between processes."""

    number: int
    """Place in the study, from 0."""
    base: Base
    seed: int
    settings: dict[str, Value]
    """Values of axes and draws, by key."""
    changes: dict[str, Value]
    """Settings that all runs of the study have in common."""
    study: str
    """Name of the study's file, for messages."""
    pictured: bool
    """Whether its contact sheet is kept."""
    files: dict[str, str] = field(default_factory=dict[str, str])
    """Digests of the files that the study names, by path."""
    named: Named = field(default_factory=dict[str, dict[str, dict[str, Value]]])
    """Groups of settings that values of `settings` name, by axis and name."""

    @property
    def scenario(self) -> str:
        """Name of the scenario that is changed."""
        return self.base.name

    @property
    def table(self) -> Table:
        """The scenario's table with all changes."""
        table = copy.deepcopy(self.base.table)
        table.pop("sweep", None)
        for key, value in ordered(self.changes | self._own()).items():
            put(table, key, value, self.study)
        put(table, "run.seed", self.seed, self.study)
        return table

    def parsed(self) -> Scenario:
        """The scenario of this run.

        Raises:
            Mistake: A setting is not valid.
        """
        scenario = scenarios.parse(self.table, self.base.name, self.base.place, self.base.table)
        check_expect(scenario)
        return scenario

    def command(self, changes: dict[str, Value]) -> str:
        """The command that repeats this run alone, given the changes of the whole study."""
        sets = [f"{k}={_toml(v)}" for k, v in ordered(changes | self._own()).items()]
        return command_line("run", self.base.name, seed=self.seed, set=sets)

    def _own(self) -> dict[str, Value]:
        """The settings of this run alone, those of named groups one by one."""
        found: dict[str, Value] = {}
        for key, value in self.settings.items():
            if key != SCENARIO:
                found |= self.named[key][value] if key in self.named else {key: value}
        return found


@dataclass(frozen=True, slots=True)
class Study:
    """A parsed study."""

    name: str
    title: str
    """A sentence that describes it."""
    table: Table
    """The table that was read, including the changes of the command line."""
    bases: tuple[Base, ...]
    changes: dict[str, Value]
    """Settings that all runs have in common."""
    axes: tuple[Axis, ...]
    named: Named
    """The groups of settings that the values of some axes name."""
    draws: tuple[Draw, ...]
    seeds: tuple[int, ...]
    compare: str | None
    """The axis whose values are compared with each other."""
    expect: dict[str, float]
    """Bounds that every cell must keep."""
    files: dict[str, str]
    """Digests of the files that it names, by path."""

    @property
    def every_axis(self) -> tuple[Axis, ...]:
        """All axes; if there are several scenarios, they are the first axis."""
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

    def runs(self) -> Iterator[Run]:
        """All runs in their order: cell by cell, seed by seed."""
        numbers = itertools.count()
        for base, cell in self.cells():
            for seed in self.seeds:
                settings = cell | {d.key: d.value(seed) for d in self.draws}
                yield self._run(next(numbers), base, seed, settings)

    def samples(self) -> Iterator[Run]:
        """A few extra runs for checking: each value of an axis and each end of a draw occurs in one
        of them, with the first values of all other axes and draws.
        """
        varied = {a.key: a.values for a in self.axes} | {d.key: d.ends for d in self.draws}
        first = {key: values[0] for key, values in varied.items()}
        for base in self.bases:
            named = {SCENARIO: base.name} if len(self.bases) > 1 else {}
            yield self._run(0, base, self.seeds[0], named | first)
            for key, values in varied.items():
                for value in values[1:]:
                    yield self._run(0, base, self.seeds[0], named | first | {key: value})

    def _run(self, number: int, base: Base, seed: int, settings: dict[str, Value]) -> Run:
        pictured = seed == self.seeds[0]
        file = f"{self.name}.toml"
        return Run(
            number, base, seed, settings, self.changes, file, pictured, self.files, self.named
        )


def ordered(settings: dict[str, Value]) -> dict[str, Value]:
    """Settings with kinds and presets first: a change of kind clears the kind's other settings."""
    return dict(sorted(settings.items(), key=lambda item: not item[0].endswith(".kind")))


def _toml(value: Value) -> str:
    """A value as TOML in one line; a text that --set would read as itself stays without quotes."""
    if isinstance(value, str) and assignment(f"key={value}") == ("key", value):
        return value
    # Inside two lists everything is written as a value, never as a table of its own.
    lines = tomli_w.dumps({"key": [[value]]}).strip().split("\n")
    return " ".join(line.strip() for line in lines).removeprefix("key = [ [ ")[: -len(", ], ]")]


@dataclass(frozen=True, slots=True, kw_only=True)
class StudyFile(Made):
    """study.json: all that defines a study."""

    FILE: ClassVar[str] = "study.json"
    KIND: ClassVar[str] = "sweep"

    name: str
    title: str
    axes: dict[str, list[Any]]
    draws: dict[str, dict[str, list[Any]]]
    """The law of each drawn setting, and its numbers."""
    seeds: list[int]
    compare: str | None
    """The axis whose values are compared with each other."""
    expect: dict[str, Number]
    runs: int
    table: dict[str, Any]
    """The study's TOML table, including the changes of the command line."""
    scenarios: dict[str, dict[str, Any]]
    """Tables of the scenarios that the study changes, by name."""
    files: dict[str, str] = field(default_factory=dict[str, str])
    """Digests of the files that these tables name, by path."""

    @staticmethod
    def of(study: Study, command: str) -> StudyFile:
        """The file of a study that a command line starts."""
        return StudyFile(
            command=command,
            versions=versions(),
            name=study.name,
            title=study.title,
            axes={a.key: list(a.values) for a in study.every_axis},
            draws={d.key: {d.law: list(d.numbers)} for d in study.draws},
            seeds=list(study.seeds),
            compare=study.compare,
            expect=study.expect,
            runs=study.size,
            table=study.table,
            scenarios={b.name: b.table for b in study.bases},
            files=study.files,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class FailureFile(Document):
    """failures/NUMBER.json: a run that ended in an error."""

    KIND: ClassVar[str] = "failure"

    run: int
    settings: dict[str, Any]
    command: str
    """The command that repeats this run alone."""
    error: str
    """The traceback."""

    @staticmethod
    def of(run: Run, error: str, command: str) -> FailureFile:
        """The file of a failed run."""
        settings = run.settings | {"seed": run.seed}
        return FailureFile(run=run.number, settings=settings, command=command, error=error)
