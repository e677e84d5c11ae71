"""A study as a value: its scenarios, axes, drawn settings and seeds, and the list of its runs."""

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
    """A study: scenarios that are run with all combinations of axis values, for several seeds."""

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
    """The axis whose values are compared with each other."""
    expect: dict[str, float]
    """Bounds on the means of measures for each combination of axis values."""
    files: dict[str, str]
    """Digests of the files that the settings name, by path."""

    @property
    def every_axis(self) -> tuple[Axis, ...]:
        """Return all axes; the first is that of scenarios if there are several scenarios."""
        several = Axis(SCENARIO, tuple(b.name for b in self.bases))
        return (several, *self.axes) if len(self.bases) > 1 else self.axes

    @property
    def keys(self) -> list[str]:
        """Return the names of all axes, such as "tracker.kind"; "scenario" is first if there are
        several scenarios.
        """
        return [axis.key for axis in self.every_axis]

    @property
    def size(self) -> int:
        """Return the number of runs."""
        cells = int(np.prod([len(a.values) for a in self.every_axis], dtype=object))
        return cells * len(self.seeds)

    def cells(self) -> Iterator[tuple[StudiedScenario, dict[str, Value]]]:
        """Yield every combination of axis values, by name of the axis, with its scenario."""
        for base in self.bases:
            named = {SCENARIO: base.name} if len(self.bases) > 1 else {}
            for values in itertools.product(*(a.values for a in self.axes)):
                yield base, named | dict(zip((a.key for a in self.axes), values, strict=True))

    def jobs(self) -> Iterator[Job]:
        """Yield all runs in their order: all seeds of the first combination of axis values, then
        those of the next.
        """
        numbers = itertools.count()
        for base, cell in self.cells():
            for seed in self.seeds:
                settings = cell | {d.key: d.value(seed) for d in self.draws}
                yield self._job(next(numbers), base, seed, settings)

    def samples(self) -> Iterator[Job]:
        """Yield runs for checking only: each value of each axis and each end of a distribution
        occurs in one of them, with the first values of all other axes and distributions.
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
