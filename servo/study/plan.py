"""A study as a value: scenarios, axes, draws and seeds, and the jobs that result from them."""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from servo.scenario.draws import Draw, Value
from servo.scenario.toml import Table
from servo.study.axes import SCENARIO, Axis
from servo.study.run import Job
from servo.study.scenario_run import StudiedScenario


@dataclass(frozen=True, slots=True)
class Study:
    """A parsed study."""

    name: str
    title: str
    """A sentence that describes it."""
    table: Table
    """The table that was read, including the changes of the command line."""
    bases: tuple[StudiedScenario, ...]
    """The scenarios, each with what all runs of the study have in common."""
    axes: tuple[Axis, ...]
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
    def keys(self) -> list[str]:
        """The settings that the axes vary."""
        return [axis.key for axis in self.every_axis]

    @property
    def size(self) -> int:
        """Number of runs."""
        cells = int(np.prod([len(a.values) for a in self.every_axis], dtype=object))
        return cells * len(self.seeds)

    def cells(self) -> Iterator[tuple[StudiedScenario, dict[str, Value]]]:
        """Every combination of axis values."""
        for base in self.bases:
            named = {SCENARIO: base.name} if len(self.bases) > 1 else {}
            for values in itertools.product(*(a.values for a in self.axes)):
                yield base, named | dict(zip((a.key for a in self.axes), values, strict=True))

    def jobs(self) -> Iterator[Job]:
        """All jobs in their order: cell by cell, seed by seed."""
        numbers = itertools.count()
        for base, cell in self.cells():
            for seed in self.seeds:
                settings = cell | {d.key: d.value(seed) for d in self.draws}
                yield self._job(next(numbers), base, seed, settings)

    def samples(self) -> Iterator[Job]:
        """A few extra jobs for checking: each value of an axis and each end of a draw occurs in one
        of them, with the first values of all other axes and draws.
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
        command = base.command(seed, settings)
        return Job(number, base, seed, settings, command, pictured=seed == self.seeds[0])
