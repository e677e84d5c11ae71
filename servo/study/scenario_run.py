"""Runs of scenarios in the closed loop: their subjects, and their records."""

import copy
import functools
import platform
import time
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w
from numpy.typing import NDArray

from servo.loop.columns import Columns
from servo.loop.episode import Episode
from servo.loop.measure import MEASURES, Measure
from servo.loop.run_measures import CONVERGED_PX, Outcome, summarise, timed
from servo.loop.step import Step
from servo.mistake import Mistake
from servo.output.formats import command_line
from servo.scenario import load as scenarios
from servo.scenario.draws import Value
from servo.scenario.expected import tracker_of
from servo.scenario.load import Scenario
from servo.scenario.named_files import digest_of
from servo.scenario.toml import Table, assignment, put
from servo.study.axes import SCENARIO, Named
from servo.study.bounds import check_expect, missed_bounds, unjudged
from servo.study.run import Job, Record
from sim.kinds import UnknownKind
from tracking.drawing.contact_sheet import page, tile
from tracking.drawing.picture_bytes import encoded
from tracking.sequences.sources import Picture

TILES = 8
JPEG_QUALITY = 80
CAMERA = tuple(f"camera_{axis}_m" for axis in "xyz")
"""The camera's place in the target's frame: x along the nose, y to its right, z into the table."""
CORNERS = tuple(f"corner{i}_{axis}_px" for i in range(4) for axis in "uv")
"""Projected corners of the target's reference rectangle."""
TRACK = 1
"""Place of the tracker's time among those of a step."""
TRACK_MS = "track_ms"
RECORDED = MEASURES | {
    TRACK_MS: Measure(TRACK_MS, "ms", "the tracker's time for a picture, median", timed=True)
}
"""The measures of a record, by name: those of a run's steps, and the time of the tracker alone."""
MEASURED = tuple(RECORDED)
TIMES = tuple(name for name, measure in RECORDED.items() if measure.timed)
"""Measured times, which differ when a run is repeated."""


@dataclass(frozen=True, slots=True)
class LoadedScenario:
    """A subject: a scenario as it was loaded, with its seed."""

    scenario: Scenario

    @property
    def name(self) -> str:
        """Name of the scenario."""
        return self.scenario.name

    def describe(self) -> dict[str, Any]:
        """The scenario's table."""
        return {"scenario": self.name, "table": self.scenario.table}

    def perform(self, job: Job, folder: Path) -> Record:
        """Run the scenario."""
        return _performed(job, self.scenario, {})


@dataclass(frozen=True, slots=True)
class StudiedScenario:
    """A subject: a scenario that a study changes, parsed where it is run."""

    name: str
    """Shipped name, or path of a TOML file."""
    table: Table
    place: str
    """Its file, for messages."""
    study: str = ""
    """The study's file, for messages."""
    changes: dict[str, Value] = field(default_factory=dict[str, Value])
    """Settings that all runs of the study have in common."""
    named: Named = field(default_factory=dict[str, dict[str, dict[str, Value]]])
    """Groups of settings that values of axes name, by axis and name."""
    files: dict[str, str] = field(default_factory=dict[str, str])
    """Digests of the files that the study names, by path."""

    def describe(self) -> dict[str, Any]:
        """The scenario's table, and what the study changes in it."""
        return {"scenario": self.name, "table": self.table, "changes": self.changes}

    def table_of(self, seed: int, settings: dict[str, Value]) -> Table:
        """The scenario's table with all changes of one run."""
        table = copy.deepcopy(self.table)
        table.pop("sweep", None)
        for key, value in _ordered(self.changes | self._own(settings)).items():
            put(table, key, value, self.study)
        put(table, "run.seed", seed, self.study)
        return table

    def parsed(self, seed: int, settings: dict[str, Value]) -> Scenario:
        """The scenario of one run.

        Raises:
            Mistake: A setting is not valid.
        """
        scenario = scenarios.parse(self.table_of(seed, settings), self.name, self.place, self.table)
        check_expect(scenario)
        return scenario

    def command(self, seed: int, settings: dict[str, Value]) -> str:
        """The command that repeats one run alone."""
        changes = _ordered(self.changes | self._own(settings))
        return command_line(
            "run", self.name, seed=seed, set=[f"{k}={_toml(v)}" for k, v in changes.items()]
        )

    def perform(self, job: Job, folder: Path) -> Record:
        """Run the scenario of a job; it was right where the study began.

        Raises:
            Mistake: This machine lacks a package, or a file differs.
        """
        for path, digest in self.files.items():
            if digest_of(path) != digest:
                raise Mistake(
                    f"on {platform.node()}, the file {path} is not the one that the study began "
                    "with"
                )
        try:
            scenario = self.parsed(job.seed, job.settings)
        except Mistake as error:
            if not isinstance(error.__cause__, UnknownKind):
                raise
            raise Mistake(f"the worker on {platform.node()} lacks a package: {error}") from error
        return _performed(job, scenario, _kept(frozenset(self.files.items())))

    def _own(self, settings: dict[str, Value]) -> dict[str, Value]:
        """The settings of one run, those of named groups one by one."""
        found: dict[str, Value] = {}
        for key, value in settings.items():
            if key != SCENARIO:
                found |= self.named[key][str(value)] if key in self.named else {key: value}
        return found


def record_of(
    job: Job,
    scenario: Scenario,
    steps: Columns | Iterable[Step],
    seconds: float = np.nan,
    sheet: bytes | None = None,
) -> Record:
    """Return the record of a run from its steps.

    Args:
        job: What was run.
        scenario: As it was run.
        steps: All of them, or their columns; they need no pictures.
        seconds: Wall-clock time.
        sheet: The run's contact sheet as JPEG.
    """
    run = Columns.of(steps)
    summary = summarise(run, scenario.measure, 1 / scenario.camera.rate)
    expected = scenario.expect.get("outcome") or scenario.bounds.success or Outcome.CONVERGED.name
    success = summary.outcome.name == expected
    as_written = scenario.bounds.of(tracker_of(scenario.table))
    missed = missed_bounds(summary.outcome.name, summary.measures, scenario.expect, as_written)
    track_ms = 1e3 * float(np.median(timed(run)[:, TRACK]))
    return Record(
        number=job.number,
        subject=job.subject.name,
        seed=job.seed,
        settings=job.settings,
        command=job.command,
        outcome=summary.outcome.name,
        limits=summary.limits,
        off=summary.off,
        success=success,
        measures=summary.measures | {TRACK_MS: track_ms},
        missed=() if unjudged(scenario, success) else missed,
        repeats=scenario.run.repeats,
        series=_series(run),
        sheet=sheet,
        seconds=seconds,
    )


class Sheet:
    """A contact sheet of some pictures of a run, evenly spaced."""

    def __init__(self, frames: int) -> None:
        self._shown = set(np.linspace(0, frames - 1, TILES).astype(int))
        self._tiles: list[Any] = []

    def add(self, step: Step) -> None:
        """Take a step with its picture, which is shown if it is one of these."""
        if step.frame.index in self._shown:
            picture = Picture(f"{step.frame.time:.1f} s", step.frame.time, step.frame.image)
            outline = step.estimate.outline(step.region)
            self._tiles.append(tile(picture, step.truth.corners, outline))

    def jpeg(self) -> bytes:
        """Return the sheet of what was added."""
        return encoded(page(self._tiles), JPEG_QUALITY)


Kept = dict[str, tuple[Any, Any]]
"""Robot and target of a run, which the next one uses again; see `Episode`."""


@functools.lru_cache(maxsize=1)
def _kept(files: frozenset[tuple[str, str]]) -> Kept:
    """Return those of this process's last run of a study, given the digests of its files. To build
    a target from a mesh takes 65 ms, three times as long as everything else before a run.
    """
    del files  # others begin anew
    return {}


def _performed(job: Job, scenario: Scenario, kept: Kept) -> Record:
    began = time.perf_counter()
    sheet = Sheet(scenario.frames) if job.pictured else None
    run = Columns()
    with Episode(scenario, seen=sheet is not None, kept=kept) as episode:
        for step in episode:
            if sheet is not None:
                sheet.add(step)
            run.add(step)
    jpeg = sheet.jpeg() if sheet else None
    return record_of(job, scenario, run, time.perf_counter() - began, jpeg)


def _ordered(settings: dict[str, Value]) -> dict[str, Value]:
    """Settings with kinds and presets first: a change of kind clears the kind's other settings."""
    return dict(sorted(settings.items(), key=lambda item: not item[0].endswith(".kind")))


def _toml(value: Value) -> str:
    """A value as TOML in one line; a text that --set would read as itself stays without quotes."""
    if isinstance(value, str) and assignment(f"key={value}") == ("key", value):
        return value
    # Inside two lists everything is written as a value, never as a table of its own.
    lines = tomli_w.dumps({"key": [[value]]}).strip().split("\n")
    return " ".join(line.strip() for line in lines).removeprefix("key = [ [ ")[: -len(", ], ]")]


def _series(run: Columns) -> dict[str, NDArray[Any]]:
    """Values over time, in the precision of the files."""
    corners = run["corners"].reshape(len(run), len(CORNERS))
    columns = {
        **dict(zip((*CAMERA, *CORNERS), np.hstack([run["camera"], corners]).T, strict=True)),
        "time_s": run["time"],
        "servo_error_px": run["servo"],
        "tracking_error_px": run["tracking"],
    }
    floats = {name: np.asarray(values, np.float32) for name, values in columns.items()}
    return {**floats, "on_target": run["tracking"] <= CONVERGED_PX}
