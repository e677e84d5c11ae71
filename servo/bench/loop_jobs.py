"""Comparison of trackers in the closed loop, where each steers the camera in some scenarios."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from servo.bench.sequence_jobs import Contender
from servo.loop.measured_run import measured_run
from servo.loop.run_measures import Outcome
from servo.output.formats import Made, Number
from servo.output.versions import versions
from servo.scenario import load as scenarios
from servo.scenario.load import Scenario
from tracking.files import atomic
from tracking.files.csv_text import csv_text
from tracking.files.json_text import number
from tracking.statistics.comparisons import Interval, mean_of

SCENARIOS = ("still", "line")
"""Scenarios that every tracker should be able to hold."""
SHOWN = {
    "rms": "servo_rms_px",
    "peak": "servo_peak_px",
    "tracker": "tracking_rms_px",
    "ms": "track_ms",
}
"""Measures in the table, by the titles of their columns."""
RANKS = "servo_rms_px"
LEGEND = (
    "true centre against the goal, rms and peak [px]; estimate against truth, rms [px]; tracker's "
    "time [ms]: means over the seeds,\nwith 95 % intervals; seeds that draw nothing, so that all "
    "runs are the same, are one unit, without an interval"
)
TIMED = ("step_ms", "track_ms")
"""Measures that differ when a run is repeated."""
COLUMNS = ("tracker", "follows", "scenario", "seed", "outcome")


@dataclass(frozen=True, slots=True)
class LoopJob:
    """A job: one tracker in one scenario with one seed."""

    contender: Contender
    scenario: str
    seed: int
    changes: tuple[str, ...] = ()
    """Changed settings, as for --set."""

    @property
    def key(self) -> str:
        return f"{self.contender.label}/{self.scenario}-{self.seed}"

    def describe(self) -> dict[str, Any]:
        return {
            "tracker": self.contender.describe(),
            "scenario": self._scenario().table,
        }

    def run(self, folder: Path) -> dict[str, Any]:
        del folder
        scenario = dataclasses.replace(self._scenario(), tracker=self.contender.config)
        steps, report = measured_run(scenario)
        followed = zip(("theta", "s"), steps[-1].estimate.follows, strict=True)
        return {
            "tracker": self.contender.label,
            "follows": ", ".join(["x", "y", *(name for name, on in followed if on)]),
            "scenario": self.scenario,
            "seed": self.seed,
            "outcome": report.outcome.name,
            "measures": {m.name: number(m.value) for m in report.measures}
            | {"track_ms": 1e3 * float(np.median([s.seconds.track for s in steps]))},
        }

    def _scenario(self) -> Scenario:
        return scenarios.load(self.scenario, list(self.changes), self.seed)


@dataclass(frozen=True, slots=True)
class LoopRun:
    """The result of one tracker in one scenario with one seed."""

    tracker: str
    follows: str
    scenario: str
    seed: int
    outcome: str
    measures: dict[str, Number | None]

    @property
    def held(self) -> bool:
        """Whether the camera held the target."""
        return self.outcome == Outcome.CONVERGED.name


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopBench(Made):
    """bench.json of `servobench bench closed_loop`."""

    FILE: ClassVar[str] = "bench.json"
    KIND: ClassVar[str] = "bench closed_loop"

    runs: list[LoopRun]


def draws(runs: Sequence[LoopRun]) -> bool:
    """Whether the seeds of one tracker in one scenario draw anything: else all runs are alike."""
    return (
        len({(r.outcome, *(v for k, v in r.measures.items() if k not in TIMED)) for r in runs}) > 1
    )


def mean(runs: Sequence[LoopRun], measure: str) -> Interval | None:
    """Mean of a measure of one tracker in one scenario with its interval over the seeds; None if no
    run has it.
    """
    found = np.array([v for r in runs if (v := r.measures.get(measure)) is not None], float)
    if not len(found):
        return None
    return mean_of(found if draws(runs) else found.mean(keepdims=True), least=0.0)


def write(runs: Sequence[LoopRun], folder: Path, command: str) -> list[Path]:
    """Write runs.csv and bench.json; their paths.

    Raises:
        OSError: A file cannot be written.
    """
    names = list(runs[0].measures)
    rows = [[*(getattr(r, c) for c in COLUMNS), *map(r.measures.get, names)] for r in runs]
    return [
        atomic.write(folder, "runs.csv", csv_text([*COLUMNS, *names], rows)),
        LoopBench(command=command, versions=versions(), runs=list(runs)).write(folder),
    ]
