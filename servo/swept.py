"""A study from Python: its runs and its cells as tables.

swept = servo.sweep("latency_gain", ["run.duration=6"], seeds=3)
swept.cells, swept.runs
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, overload

import pyarrow as pa
from pyarrow import csv

from servo import notebook
from servo.mistake import Refused
from servo.output.formats import command_line
from servo.report.study_data import cell_row
from servo.report.words import Table
from servo.scenario import given
from servo.study.execute import Workers, complete
from servo.study.failure import ClusterLost, Failure
from servo.study.files import StudyFile
from servo.study.parse import load
from servo.study.plan import Study
from servo.study.record import Record, table_of
from servo.study.results import Cell, cells_csv, cells_of
from servo.study.store import Store, opened
from sim.camera import gl

SHOWN = ("servo_rms_px", "servo_peak_px", "tracking_rms_px")
"""Means of a cell that a notebook shows; `cells` has all."""


def sweep(
    study: str | Path,
    overrides: Sequence[str] = (),
    seeds: int | None = None,
    workers: int = 2,
    out: str | Path | None = None,
) -> Sweep:
    """Do the runs of a study on worker processes; in a notebook with a progress bar.

    Args:
        study: A name or a file.
        overrides: Settings of all runs, such as "run.duration=6".
        seeds: Replaces the study's seeds by 0, 1, ... up to this number.
        workers: How many processes.
        out: The study's folder, as `servobench sweep --out` has it: what is there already is not
            done again. By default nothing is kept.

    Raises:
        Mistake: The study, a setting or the folder is wrong.
        Refused: The workers cannot work, or every run failed.
    """
    study = given.name(study, "study")
    overrides = given.texts(overrides)
    seeds = None if seeds is None else given.whole(seeds, "seeds", 1)
    workers = given.whole(workers, "workers", 1)
    out = None if out is None else given.name(out, "folder")
    plan = load(study, overrides, seeds)
    gl.backend()
    command = command_line("sweep", study, set=list(overrides), seeds=seeds)
    with ExitStack() as stack:
        folder = stack.enter_context(TemporaryDirectory()) if out is None else out
        store = stack.enter_context(opened(Path(folder), StudyFile.of(plan, command)))
        failed = _complete(plan, store, stack.enter_context(Workers(workers)))
        records = store.records(plan.jobs())
        if not records:
            raise Refused(f"every run of {plan.name} failed; the first: {failed[0]}")
        return Sweep(plan, records, failed)


def _complete(study: Study, store: Store, workers: Workers) -> list[str]:
    """Do the missing runs; a sentence for each that failed."""
    failed = list[str]()
    jobs = list(study.jobs())
    store.find(jobs)
    with notebook.progress(study.name, study.size) as bar:
        try:
            for job, end in complete(jobs, store, workers):
                if isinstance(end, Failure):
                    failed.append(f"{end.reason} (again: {job.command})")
                bar(len(store.done) + len(failed), f"{len(failed)} failed")
        except ClusterLost as lost:
            raise Refused(f"{lost}; give `out` to go on from what is finished") from None
    return failed


@dataclass(frozen=True, repr=False, eq=False)
class Sweep(Sequence[Record]):
    """A study whose runs are done: as a sequence it is their records."""

    study: Study
    records: list[Record]
    failed: list[str] = field(default_factory=list[str])
    """A sentence for each run that failed, with the command that repeats it."""

    def __len__(self) -> int:
        return len(self.records)

    @overload
    def __getitem__(self, index: int) -> Record: ...
    @overload
    def __getitem__(self, index: slice) -> list[Record]: ...
    def __getitem__(self, index: int | slice) -> Record | list[Record]:
        return self.records[index]

    @cached_property
    def runs(self) -> Any:
        """A row for each run: a DataFrame, or, without pandas, an Arrow table."""
        return notebook.frame_of(table_of(self.records))

    @cached_property
    def cells(self) -> Any:
        """A row for each combination of axis values: success rate and means with 95 % intervals."""
        text = cells_csv(self.study, self._cells).encode()
        table = csv.read_csv(pa.BufferReader(text))
        numbers = [pa.float64() if pa.types.is_null(t) else t for t in table.schema.types]
        return notebook.frame_of(
            table.cast(pa.schema(zip(table.column_names, numbers, strict=True)))
        )

    @cached_property
    def _cells(self) -> list[Cell]:
        return cells_of(self.study, table_of(self.records).to_pylist())

    def __repr__(self) -> str:
        runs = len(self)
        cells = len(self._cells)
        return f"Sweep({self.study.name}: {runs} runs, {cells} cells, {len(self.failed)} failed)"

    def _repr_html_(self) -> str:
        keys = [axis.key for axis in self.study.every_axis]
        rows = [cell_row(cell, SHOWN) for cell in self._cells]
        return notebook.html_table(Table((*keys, "units", "held", *SHOWN), rows))
