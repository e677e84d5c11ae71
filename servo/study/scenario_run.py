"""Runs scenarios in the closed loop as jobs of a study, and makes the records of the runs."""

import functools
import platform
import time
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import tomli_w

from servo.loop.columns import Columns
from servo.loop.episode import Episode, Kept
from servo.loop.measure import MEASURES, Measure
from servo.loop.run_measures import CONVERGED_PX, Outcome, summarise, timed
from servo.loop.step import Step
from servo.mistake import Mistake, check_rules
from servo.output.formats import command_line
from servo.scenario import load as scenarios
from servo.scenario.draws import Value
from servo.scenario.expected import tracker_of
from servo.scenario.load import Scenario
from servo.scenario.named_files import digest_of
from servo.scenario.toml import Table, assignment, with_settings
from servo.study.bounds import missed_bounds, unjudged
from servo.study.run import SCENARIO, Job, Record, Series
from sim.kinds import UnknownKind
from sim.types import Image
from tracking.drawing.contact_sheet import page, tile
from tracking.drawing.picture_bytes import encoded
from tracking.sequences.sources import Picture

Named = dict[str, dict[str, Table]]
"""Groups of settings by the name of their axis and their own name: the study's table [named]."""
TILES = 8
"""Largest number of pictures in a contact sheet."""
JPEG_QUALITY = 80
CAMERA = tuple(f"camera_{axis}_m" for axis in "xyz")
"""Names of the series of the camera's position in the frame of the target's reference rectangle
[m]: x ahead, y to the right, z down."""
CORNERS = tuple(f"corner{i}_{axis}_px" for i in range(4) for axis in "uv")
"""Names of the series of the true image corners of the target's reference rectangle [px]."""
TRACK = 1
"""Index of the tracker's time among the times of a step."""
TRACK_MS = "track_ms"
RECORDED = MEASURES | {
    TRACK_MS: Measure(TRACK_MS, "ms", "the tracker's time for a picture, median", timed=True)
}
"""The measures of a record, by name: those of a run, and the time of the tracker alone."""
MEASURED = tuple(RECORDED)
TIMES = tuple(name for name, measure in RECORDED.items() if measure.timed)
"""Names of measured times, which differ when a run is repeated."""


@dataclass(frozen=True, slots=True)
class LoadedScenario:
    """A scenario that is run as it was loaded, with its own settings and seed; the settings and the
    seed of the job are only copied into the record.
    """

    scenario: Scenario

    @property
    def name(self) -> str:
        """Return the name of the scenario."""
        return self.scenario.name

    def describe(self) -> Table:
        """Return the name of the scenario and its table, as in a TOML file, by the keys "scenario"
        and "table".
        """
        return {"scenario": self.name, "table": self.scenario.table}

    def perform(self, job: Job, folder: Path) -> Record:
        """Run the scenario with its own settings and seed, and return the record (the results),
        which has the number, seed, settings and command of the job. No file is written into
        `folder`.

        Raises:
            Mistake: A component fails.
        """
        return _performed(job, self.scenario, {})


@dataclass(frozen=True, slots=True)
class StudiedScenario:
    """A scenario of a study (its table without changes), with the settings that the study changes
    in all runs (`changes`), its groups of settings (`named`), and the digests of the files that the
    settings name. For each run the table is copied, changed and checked.
    """

    name: str
    """Shipped name, or path of a TOML file."""
    table: Table
    """The scenario's table, without changes."""
    place: str
    """The scenario's file, for messages."""
    study: str = ""
    """The study's file, for messages."""
    changes: Table = field(default_factory=dict[str, object])
    """Settings of all runs of the study, by dotted key."""
    named: Named = field(default_factory=dict[str, dict[str, Table]])
    """Groups of settings by axis and name."""
    files: dict[str, str] = field(default_factory=dict[str, str])
    """Digests of the files that the study names, by path."""

    def describe(self) -> Table:
        """Return the name of the scenario, its table without changes, the settings of all runs of
        the study, its groups of settings and the digests of its files, by the keys "scenario",
        "table", "changes", "named" and "files".
        """
        found: Table = {"scenario": self.name, "table": self.table, "changes": self.changes}
        return found | {"named": self.named, "files": self.files}

    def table_of(self, seed: int, settings: Table) -> Table:
        """Return a copy of the scenario's table (as in a TOML file) with all changes of one run and
        without the table [sweep].

        Args:
            seed: The run's seed, which becomes run.seed.
            settings: The run's values of the settings that the study varies or draws at random, by
                name.

        Raises:
            Mistake: The path of a setting goes through a value that is no table, has more than 20
                names, or ends in a list without such an item.
        """
        changes = self.changes | self._own(settings) | {"run.seed": seed}
        table = with_settings(self.table, changes, self.study)
        table.pop("sweep", None)
        return table

    def parsed(self, seed: int, settings: Table) -> Scenario:
        """Return the checked scenario of one run.

        Args:
            seed: The run's seed.
            settings: The run's values of the settings that the study varies or draws at random, by
                name.

        Raises:
            Mistake: A setting, or a bound on a measure in [expect], is not valid.
        """
        return scenarios.parse(self.table_of(seed, settings), self.name, self.place, self.table)

    def command(self, seed: int, settings: Table) -> str:
        """Return the command line `servobench run ...` that repeats one run alone.

        Args:
            seed: The run's seed.
            settings: The run's values of the settings that the study varies or draws at random, by
                name.
        """
        changes = _ordered(self.changes | self._own(settings))
        return command_line(
            "run", self.name, seed=seed, set=[f"{k}={_toml(v)}" for k, v in changes.items()]
        )

    def perform(self, job: Job, folder: Path) -> Record:
        """Run the scenario with the seed and the settings of a job, and return the record (the
        results). No file is written into `folder`.

        Raises:
            Mistake: A setting is not valid, a component fails, a package that the scenario needs is
                missing on this machine, or a file that the study names is missing or has changed
                since the study began.
        """
        check_rules(
            *(
                (
                    digest_of(path) != digest,
                    f"on {platform.node()}, the file {path} is missing or differs from the one at "
                    "the start of the study: restore it, or copy it to that machine",
                )
                for path, digest in self.files.items()
            )
        )
        try:
            scenario = self.parsed(job.seed, job.settings)
        except Mistake as error:
            if not isinstance(error.__cause__, UnknownKind):
                raise
            raise Mistake(
                f"the worker on {platform.node()} lacks a package of this study; install it there: "
                f"{error}"
            ) from error
        return _performed(job, scenario, _kept(frozenset(self.files.items())))

    def _own(self, settings: Table) -> Table:
        """Return the settings of one run by dotted key. On an axis of the table [named], a value is
        the name of a group of settings; these settings take its place.
        """
        found: Table = {}
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
    """Return the record (outcome, measures, missed bounds, series over time) of a run.

    Args:
        job: The job of the run, from which number, name of the scenario, seed, settings and command
            are copied.
        scenario: The scenario that was run.
        steps: All steps of the run, or their columns; pictures are not used.
        seconds: Wall-clock time of the run [s]; nan: unknown.
        sheet: An image with pictures of the run, as JPEG; None: none was drawn.
    """
    run = Columns.of(steps)
    summary = summarise(run, scenario.measure, 1 / scenario.camera.rate)
    expected = scenario.bounds.expect.get("outcome", Outcome.CONVERGED.name)
    # The outcome in [expect] counts for every tracker without one of its own.
    success = summary.outcome.name == scenario.expect.get("outcome", expected)
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
    """A contact sheet of a run of `frames` steps: one image with eight of the run's pictures,
    evenly spaced from the first to the last; with all pictures of a shorter run.
    """

    def __init__(self, frames: int) -> None:
        self._shown = set(np.linspace(0, frames - 1, TILES).astype(int))
        self._tiles: list[Image] = []

    def add(self, step: Step) -> None:
        """Draw the picture of a step into the sheet, with the true and the estimated outline of the
        target, if it is one of the pictures of the sheet; other steps are ignored.
        """
        if step.frame.index in self._shown:
            picture = Picture(f"{step.frame.time:.1f} s", step.frame.time, step.frame.image)
            outline = step.estimate.outline(step.region)
            self._tiles.append(tile(picture, step.truth.corners, outline))

    def jpeg(self) -> bytes:
        """Return the image with the pictures that were drawn so far, as the bytes of a JPEG
        file.
        """
        return encoded(page(self._tiles), JPEG_QUALITY)


@functools.lru_cache(maxsize=1)
def _kept(files: frozenset[tuple[str, str]]) -> Kept:
    """Return the dictionary in which `Episode` keeps robot and target for the next run; a new one
    if `files`, the digests of the study's files, differ from those of the last call.

    To build a target from a mesh takes 65 ms, three times as long as everything else before a run.
    """
    del files
    return {}


def _performed(job: Job, scenario: Scenario, kept: Kept) -> Record:
    """Run a scenario, and return the record of the job."""
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


def _ordered(settings: Table) -> Table:
    """Return settings by dotted key with the kinds of components first: a change of a kind clears
    the other settings of its table.
    """
    return dict(sorted(settings.items(), key=lambda item: not item[0].endswith(".kind")))


def _toml(value: Value) -> str:
    """Return a value as TOML in one line; a text is quoted only if --set would misread it."""
    if isinstance(value, str) and assignment(f"key={value}") == ("key", value):
        return value
    # Inside two lists a table is written inline, and not under a header of its own.
    lines = tomli_w.dumps({"key": [[value]]}).strip().split("\n")
    return " ".join(line.strip() for line in lines).removeprefix("key = [ [ ")[: -len(", ], ]")]


def _series(run: Columns) -> dict[str, Series]:
    """Return the values over time of a run by name, in single precision; "on_target" is true where
    the tracking error is at most `CONVERGED_PX`.
    """
    corners = run["corners"].reshape(len(run), len(CORNERS))
    columns = {
        **dict(zip((*CAMERA, *CORNERS), np.hstack([run["camera"], corners]).T, strict=True)),
        "time_s": run["time"],
        "servo_error_px": run["servo"],
        "tracking_error_px": run["tracking"],
    }
    floats = {name: np.asarray(values, np.float32) for name, values in columns.items()}
    return {**floats, "on_target": run["tracking"] <= CONVERGED_PX}
