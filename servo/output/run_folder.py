"""The folder of a run: run.rrd, steps.parquet, report.json and two plots."""

from __future__ import annotations

import traceback
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

from servo.loop.episode import Episode
from servo.loop.part import PartFailed
from servo.loop.run_measures import Report, Violation
from servo.loop.step import Scene, Step
from servo.mistake import Mistake, Refused, unwritable
from servo.output import plots
from servo.output.formats import Made, Number
from servo.output.sinks import Sink, Sinks
from servo.output.steps_table import STREAM, TABLE, StepsTable
from servo.output.versions import versions
from servo.scenario import load as scenarios
from servo.scenario.load import Scenario
from sim.models.target import dimensions
from tracking.files import atomic
from tracking.files.json_text import as_json, number

RECORDING = "run.rrd"
TRACEBACK = "traceback.txt"


@dataclass(frozen=True, slots=True, kw_only=True)
class RunReport(Made):
    """Outcome, measures, bounds and settings of a run."""

    FILE: ClassVar[str] = "report.json"
    KIND: ClassVar[str] = "run"

    scenario: str
    seed: int
    outcome: str
    """The name of an `Outcome`."""
    measures: dict[str, Number | None]
    """Values of the measures by name; None if there is no finite value."""
    units: dict[str, str]
    """Units of the measures by name."""
    expect: dict[str, Number | str]
    """The scenario's bounds for its tracker."""
    missed: list[Violation]
    """The bounds that were not kept."""
    features: dict[str, str]
    """Units of the features by name."""
    feed_forward: list[str]
    """Features for which the target's motion is drawn."""
    settings: dict[str, Any]
    """All settings of the run, including defaults and the target's rectangle."""
    table: dict[str, Any]
    """The scenario's TOML table, including changes."""
    rates: dict[str, Number] = field(default_factory=dict)
    """Rates that the run used [Hz], where the camera's rate left those asked for no whole steps."""
    unjudged: str = ""
    """Why there is no verdict, where the bounds are made for another tracker."""

    @staticmethod
    def of(
        scenario: Scenario, scene: Scene, report: Report, missed: list[Violation], command: str
    ) -> RunReport:
        """The report of a run, with the command line that repeats it."""
        features = scene.features
        settings = scenario.settings()
        settings["target"] |= {"outline": dimensions(scene.outline)}
        return RunReport(
            command=command,
            versions=versions(),
            scenario=scenario.name,
            seed=scenario.run.seed,
            outcome=report.outcome.name,
            measures={m.name: number(m.value) for m in report.measures},
            units={m.name: m.unit for m in report.measures},
            expect=scenario.expect,
            missed=missed,
            features=dict(zip(features.names, features.units, strict=True)),
            feed_forward=list(features.feed_forward),
            settings=as_json(settings),
            table=_table(scenario),
            rates=scenario.rates_changed,
            unjudged=scenario.unjudged,
        )


def _table(scenario: Scenario) -> dict[str, Any]:
    """The scenario's table; if Python changed a setting, a table of all settings."""
    settings = scenario.settings()
    try:
        same = scenarios.parse(scenario.table, scenario.name, scenario.name).settings() == settings
    except Mistake:
        same = False
    return as_json(
        scenario.table if same else _without_none(settings | {"expect": scenario.expect})
    )


def _without_none(value: Any) -> Any:
    """A value without settings that are None: TOML has no null, and None is their default."""
    if isinstance(value, dict):
        return {key: _without_none(item) for key, item in value.items() if item is not None}
    return [_without_none(item) for item in value] if isinstance(value, list) else value


def prepare(asked: Path | None, name: str) -> Path:
    """The empty folder to write to: the one asked for, or the next free runs/NAME.

    Raises:
        Mistake: It is not empty, cannot be written, or its name is not UTF-8.
    """
    _check_name(asked or Path(name))
    try:
        if asked is None:
            return _next_free(Path("runs"), name)
        if asked.is_dir() and any(asked.iterdir()):
            raise Mistake(f"{asked}: there is something in this folder; choose another with --out")
        asked.mkdir(parents=True, exist_ok=True)
        atomic.write(asked, RECORDING, b"").unlink()  # a test
    except OSError as error:
        raise unwritable(asked or Path("runs") / name, error) from None
    return asked


def with_traceback(error: PartFailed, folder: Path) -> Mistake:
    """The same sentence, where the traceback of its cause is kept in the folder."""
    if error.__cause__ is None:
        return error
    text = "".join(traceback.format_exception(error.__cause__))
    path = atomic.write(folder, TRACEBACK, text.encode(errors="replace"))
    return Mistake(f"{error}; its traceback is in {path}")


def _check_name(folder: Path) -> None:
    try:
        str(folder).encode()
    except UnicodeEncodeError:
        raise Mistake(
            f"{folder}: recordings need a folder whose name is UTF-8; choose another with --out"
        ) from None


def _next_free(runs: Path, name: str) -> Path:
    """Make a new folder, safely also when other runs make theirs at the same time."""
    runs.mkdir(parents=True, exist_ok=True)
    folder = runs / name
    again = 2
    while True:
        try:
            folder.mkdir()
        except FileExistsError:
            folder = runs / f"{name}-{again}"
            again = again + 1
        else:
            return folder


class RunFolder:
    """Writer of the steps of one run, and of its report and plots at the end.

    Rows have priority: their space on the disk is reserved, and they continue when the recording
    cannot be written any more.
    """

    def __init__(
        self,
        folder: Path,
        episode: Episode,
        *,
        rerun: bool,
        command: str = "",
        more: Mapping[Path | str, Sink] | None = None,
    ) -> None:
        """Open the files.

        Args:
            folder: Where to write.
            episode: The run.
            rerun: Whether a recording is written.
            command: The line that repeats the run.
            more: What else takes the steps.

        Raises:
            Mistake: Another run is writing into this folder.
            Refused: The disk has no space for the rows.
        """
        self.folder = folder
        self._scenario = episode.scenario
        self._command = command
        at_once = max(1, round(episode.scenario.camera.rate))
        try:
            self._table = StepsTable(folder, episode, at_once)
        except FileExistsError:
            raise Mistake(f"{folder}: another run is writing into this folder") from None
        except OSError as error:
            (folder / STREAM).unlink(missing_ok=True)
            sentence = f"{folder / STREAM}: there is no room for the rows: {error.strerror}"
            raise Refused(sentence) from None
        sinks: dict[Path | str, Sink] = {}
        if rerun:
            # rerun takes half a second to import
            from servo.output.recording.archetypes import RecordingFile
            from servo.output.recording.log import RerunLog

            path = folder / RECORDING
            sinks[path] = RerunLog(RecordingFile(path), episode, at_once)
        self._sinks = Sinks({**sinks, **(more or {})})

    @property
    def refused(self) -> Refused | None:
        """Why something beside the rows is not complete; None if everything is."""
        return self._sinks.refused

    def add(self, step: Step) -> None:
        """Write a step."""
        self._table.add(step)
        self._sinks.add(step)

    def close(self) -> None:
        """Finish the recording and the table.

        Raises:
            Refused: The table cannot be written; the rows are in the stream.
        """
        self._sinks.close()
        try:
            self._table.close()
        except OSError as error:
            kept = f"all rows are in {self.folder / STREAM}"
            raise Refused(f"{self.folder / TABLE}: {error.strerror}; {kept}") from None

    def finish(
        self, steps: Sequence[Step], report: Report, missed: Sequence[Violation]
    ) -> list[Path]:
        """Write report and plots; the paths of all files.

        Raises:
            Refused: A file cannot be written; the rows are complete.
        """
        found = RunReport.of(self._scenario, steps[0].scene, report, list(missed), self._command)
        title = f"{self._scenario.name}, seed {self._scenario.run.seed}"
        try:
            written = found.write(self.folder)
            drawn = plots.draw(steps, title, self.folder)
        except OSError as error:
            raise Refused.by(error, f"all rows are in {self.folder / TABLE}") from None
        return [*self._sinks.paths, self.folder / TABLE, written, *drawn]
