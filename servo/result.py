"""`servo.simulate` and `servo.sweep`, and what they return: a run with its measures, steps, figure
and film, or a study with tables of its runs and cells.

result = servo.simulate("reversal", gain=1.5)
result.measures, result.steps, result.figure(), result.frame(7.7)

study = servo.sweep("latency_gain", ["run.duration=6"], seeds=3)
study.cells, study.runs
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from functools import cached_property
from html import escape
from importlib.util import find_spec
from pathlib import Path
from typing import Any, overload

import cv2
import numpy as np
import pyarrow as pa
from PIL import Image as Pillow
from pyarrow import csv

from servo import notebook
from servo.loop.episode import Episode
from servo.loop.measure import MEASURES, pose_measures
from servo.loop.run_measures import Outcome
from servo.loop.step import Step
from servo.mistake import Mistake, Refused, writing
from servo.output import plots, steps_table
from servo.output.annotated import annotated
from servo.output.formats import command_line
from servo.output.run_curves import RunCurves
from servo.report.study_data import cell_row
from servo.report.words import Table, shown
from servo.scenario import arguments
from servo.scenario.load import Scenario, load
from servo.study import parse
from servo.study.bounds import MissedBound, unjudged
from servo.study.execute import Workers, complete
from servo.study.plan import Study
from servo.study.record_file import rows_of
from servo.study.results import Cell, cells_csv, cells_of, moved
from servo.study.run import ClusterLost, Failure, Job, Record
from servo.study.scenario_run import LoadedScenario, record_of
from servo.study.store import StudyFile, opened
from sim.camera import gl
from tracking.drawing.figures import Drawing
from tracking.drawing.picture_bytes import encoded

QUALITY = 95
"""JPEG quality of the pictures that are kept: 30 kB instead of 230 kB for one of 320 x 240 px."""
MISSING = "the extra 'notebook' is not installed: pip install 'servobench[notebook]'"


def simulate(
    scenario: str | Path | Scenario,
    overrides: Sequence[str] = (),
    seed: int | None = None,
    **settings: object,
) -> Run:
    """Run a scenario to its end and return the run with all its steps and pictures; in a notebook a
    progress bar is shown meanwhile.

    Args:
        scenario: Name of a shipped scenario, a TOML file, or what `servo.load` returned.
        overrides: Changes of settings, such as "controller.gain=1.5".
        seed: Seed of the run; None: the scenario's.
        **settings: Settings by their last name, such as gain=1.5 or tracker=MyTracker, as for
            `servo.load`.

    Raises:
        Mistake: The scenario or a setting does not exist, its value is not allowed, a component
            fails, or changes are given with a loaded scenario.
    """
    if not isinstance(scenario, Scenario):
        scenario = load(scenario, overrides, seed, **settings)
    elif overrides or settings or seed is not None:
        raise Mistake("a loaded scenario cannot be changed: give the changes to servo.load")
    steps = list[Step]()
    pictures = list[bytes]()
    with Episode(scenario) as episode, notebook.progress(scenario.name, episode.frames) as bar:
        for step in episode:
            pictures.append(encoded(step.frame.image, QUALITY))
            steps.append(replace(step, frame=step.light().frame))  # with its particles
            bar(len(steps), f"error {step.servo_error:.1f} px")
    record = record_of(Job(0, LoadedScenario(scenario), scenario.run.seed), scenario, steps)
    return Run(scenario, record, episode, steps, pictures)


@dataclass(frozen=True, eq=False, repr=False)
class Run(Sequence[Step]):
    """A finished run: its outcome, measures, steps, figure and film. As a sequence it holds the
    run's steps; their pictures have been compressed as JPEG, and their depth pictures are left out.
    """

    scenario: Scenario
    record: Record
    _episode: Episode
    _light: list[Step]
    _pictures: list[bytes]

    def __copy__(self) -> Run:
        return replace(self)

    def __deepcopy__(self, memo: dict[int, object]) -> Run:
        """Return a copy of the run that shares its steps, world and pictures, as these never
        change.
        """
        return replace(self)

    def __getstate__(self) -> dict[str, object]:
        """Raise an error, as a run cannot be pickled: MuJoCo's model of the world cannot be.

        Raises:
            Mistake: Always.
        """
        raise Mistake(
            "a run cannot be pickled, as it holds the simulated world: pickle its scenario and its "
            "tables (result.steps, result.measures)"
        )

    def __len__(self) -> int:
        return len(self._light)

    @overload
    def __getitem__(self, index: int) -> Step: ...
    @overload
    def __getitem__(self, index: slice) -> list[Step]: ...
    def __getitem__(self, index: int | slice) -> Step | list[Step]:
        if isinstance(index, slice):
            return [self[i] for i in range(len(self))[index]]
        light = self._light[index]
        raw = np.frombuffer(self._pictures[index], np.uint8)
        image = np.asarray(cv2.imdecode(raw, cv2.IMREAD_COLOR_RGB), np.uint8)
        return replace(light, frame=replace(light.frame, image=image))

    def __repr__(self) -> str:
        rms = self.record.measures["servo_rms_px"]
        return f"Run({self.title}: {self.outcome.name}, {rms:.2f} px rms, {len(self)} steps)"

    @property
    def title(self) -> str:
        """The name of the scenario and the seed, as in "reversal, seed 3"."""
        return f"{self.scenario.name}, seed {self.scenario.run.seed}"

    @property
    def outcome(self) -> Outcome:
        """The way in which the run ended, such as CONVERGED or TARGET_LOST."""
        return Outcome[self.record.outcome]

    @property
    def missed(self) -> tuple[MissedBound, ...]:
        """The bounds that the run's measures or outcome miss, of those that the scenario sets in
        its table `[expect]`.
        """
        return self.record.missed

    @cached_property
    def measures(self) -> Any:
        """Table with a row for each measure: its value, unit, bound (empty without one) and
        meaning. A pandas DataFrame whose index is the measures' names, or, without pandas, a
        `TextTable`: an Arrow table that prints its rows and columns.
        """
        columns = {
            "measure": list(MEASURES),
            "value": [self.record.measures[name] for name in MEASURES],
            "unit": [measure.unit for measure in MEASURES.values()],
            "bound": [self.scenario.expect.get(name) for name in MEASURES],
            "meaning": [measure.meaning for measure in MEASURES.values()],
        }
        table = notebook.frame_of(pa.table(columns))
        is_plain = isinstance(table, pa.Table)
        return notebook.TextTable(table) if is_plain else table.set_index("measure")

    @cached_property
    def steps(self) -> Any:
        """Table with a row for each frame and the columns of the file steps.parquet, which
        `servobench run` writes: a pandas DataFrame, or, without pandas, an Arrow table.
        """
        return notebook.frame_of(self._table)

    @cached_property
    def _table(self) -> pa.Table:
        return steps_table.table_of(self._light, steps_table.quantities_of(self._episode))

    def figure(self) -> Drawing:
        """Return a figure of the run over time: the feature errors in their units, the distances of
        the target's true centre from the goal and from the tracker's estimate [px], and the rates
        of the features that the target's own motion causes.
        """
        return plots.figure(RunCurves.of(self._table, self._episode.loop.features), self.title)

    def frame(self, time: float) -> Pillow.Image:
        """Return the picture nearest to a time of the run [s], with a line of text and the outlines
        of the target: true (white), at the goal (red), and as the tracker estimates it. A small
        picture is enlarged to about 640 px in width.

        Raises:
            Mistake: The time is not between 0 and the time of the last picture.
        """
        times = np.array([s.frame.time for s in self._light])
        (time,) = arguments.numbers((time,), "frame(time)", 1).tolist()
        if not times[0] <= time <= times[-1]:
            raise Mistake(
                f"frame({time:g}): this time is not in the run, from 0 to {times[-1]:.6g} s"
            )
        return Pillow.fromarray(annotated(self[int(np.abs(times - time).argmin())]))

    def film(self) -> Clip:
        """Return the whole run as a film (MP4, H.264), which a notebook plays."""
        from servo.output.film import write_film  # it renders the room

        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "film.mp4"
            write_film(self, path, self.title)
            return Clip(path.read_bytes())

    def view(self) -> None:
        """Show the run in Rerun's viewer, inside the notebook.

        Raises:
            Mistake: The extra 'notebook' is not installed, or this process is no notebook.
        """
        if find_spec("rerun_notebook") is None:
            raise Mistake(f"view: {MISSING}")
        if not notebook.in_notebook():
            raise Mistake(
                "Run.view: this is no notebook; record with 'servobench run', and "
                "open the folder with 'servobench view'"
            )
        # rerun takes half a second to import
        from servo.output.recording.destination import NotebookRecording
        from servo.output.recording.log import RerunLog

        log = RerunLog(NotebookRecording(), self._episode)
        for step in self:
            log.add(step)
        log.close()

    def _repr_html_(self) -> str:
        """Return the outcome, a short table of measures and the plots as HTML, for a notebook."""
        missed = "; ".join(map(str, self.missed))
        verdict = f"missed: {missed}" if missed else "all bounds kept"
        verdict = verdict if self.scenario.expect else "no bounds"
        verdict = unjudged(self.scenario, self.record.success) or verdict
        of_pose = pose_measures(len(self._episode.loop.features.names))
        rows = [
            [name, shown(self.record.measures[name]), measure.unit, measure.meaning]
            for name, measure in MEASURES.items()
            if measure.brief or name in of_pose
        ]
        sentence = self.outcome.sentence(self.record.limits, self.record.off)
        ending = escape(f"{self.outcome.name}. {sentence} ({verdict})")
        table = notebook.html_table(Table(("measure", "value", "unit", "meaning"), rows))
        plot = notebook.html_picture(self.figure().png())
        return f"<p><b>{escape(self.title)}</b>: {ending}</p>{table}{plot}"


@dataclass(frozen=True)
class Clip:
    """A film (MP4) in memory, which a notebook plays."""

    mp4: bytes = field(repr=False)

    def save(self, path: str | Path) -> None:
        """Write the film to an MP4 file.

        Raises:
            Mistake: The file cannot be written at this path.
            Refused: The disk is full.
        """
        with writing(path, "this film"):
            Path(arguments.name(path, "film")).write_bytes(self.mp4)

    def _repr_html_(self) -> str:
        return notebook.html_film(self.mp4)


def sweep(
    study: str | Path,
    overrides: Sequence[str] = (),
    seeds: int | None = None,
    workers: int = 2,
    out: str | Path | None = None,
) -> Sweep:
    """Do the runs of a study (a scenario over axes of settings and seeds) on worker processes, and
    return their results; in a notebook a progress bar is shown meanwhile.

    Args:
        study: Name of a shipped study, or a TOML file.
        overrides: Settings of all runs, such as "run.duration=6".
        seeds: Number of seeds 0, 1, 2, ... in place of the study's; None: the study's.
        workers: Number of processes.
        out: The study's folder, as for `servobench sweep --out`: runs that it already has are not
            repeated. None: nothing is stored.

    Raises:
        Mistake: The study or a setting does not exist, or the folder belongs to another study.
        Refused: The worker processes died, or every run failed.
    """
    study = arguments.name(study, "study")
    overrides = arguments.texts(overrides)
    seeds = None if seeds is None else arguments.whole(seeds, "seeds", 1)
    workers = arguments.whole(workers, "workers", 1)
    out = None if out is None else arguments.name(out, "folder")
    plan = parse.load(study, overrides, seeds)
    jobs = list(plan.jobs())
    gl.is_there()
    command = command_line("sweep", study, set=list(overrides), seeds=seeds)
    failed = list[str]()
    with ExitStack() as stack:
        folder = stack.enter_context(tempfile.TemporaryDirectory()) if out is None else out
        store = stack.enter_context(opened(Path(folder), StudyFile.of(plan, command)))
        team = stack.enter_context(Workers(workers))
        store.find(jobs)
        bar = stack.enter_context(notebook.progress(plan.name, plan.size))
        try:
            for job, end in complete(jobs, store, team):
                if isinstance(end, Failure):
                    failed.append(f"{end.reason} (again: {job.command})")
                bar(len(store.done) + len(failed), f"{len(failed)} failed")
        except ClusterLost as lost:
            raise Refused(
                f"{lost}; call sweep again: with a folder `out` it keeps the finished runs"
            ) from None
        if not store.done:
            raise Refused(f"every run of {plan.name} failed; the first: {failed[0]}")
        return Sweep(plan, store.records(jobs), store.table(), failed)


@dataclass(frozen=True, repr=False, eq=False)
class Sweep:
    """The results of a finished study (a scenario over axes of settings and seeds): the record
    of each finished run, the same as a table with a row for each run, and a sentence for each run
    that failed; `cells` is a table of the cells (combinations of axis values).
    """

    study: Study
    records: Sequence[Record]
    """The record of each finished run, as `Run.record`."""
    table: pa.Table
    """The same as a table: a row for each run."""
    failed: list[str]
    """A sentence for each run that failed, with the command that repeats it."""

    @cached_property
    def runs(self) -> Any:
        """Table with a row for each finished run, with its axis values and measures: a pandas
        DataFrame, or, without pandas, an Arrow table.
        """
        return notebook.frame_of(self.table)

    @cached_property
    def cells(self) -> Any:
        """Table with a row for each cell (combination of axis values): the success rate (0 to 1),
        and the means of the measures over the runs of the cell, with 95 % intervals. A pandas
        DataFrame, or, without pandas, an Arrow table.
        """
        table = csv.read_csv(pa.BufferReader(cells_csv(self.study, self._cells).encode()))
        numbers = [pa.float64() if pa.types.is_null(t) else t for t in table.schema.types]
        return notebook.frame_of(
            table.cast(pa.schema(zip(table.column_names, numbers, strict=True)))
        )

    @cached_property
    def _cells(self) -> list[Cell]:
        return cells_of(self.study, rows_of(self.table))

    def __repr__(self) -> str:
        runs = self.table.num_rows
        cells = len(self._cells)
        return f"Sweep({self.study.name}: {runs} runs, {cells} cells, {len(self.failed)} failed)"

    def _repr_html_(self) -> str:
        measures = moved(self._cells)
        rows = [cell_row(cell, measures) for cell in self._cells]
        return notebook.html_table(Table((*self.study.keys, "units", "success", *measures), rows))
