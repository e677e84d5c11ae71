"""The steps of a run as a table: one row a frame, column names with units, stored as Parquet.

While a run lasts its rows go to an Arrow stream beside the table, a second's worth at a time, so
that a killed run keeps them: `pyarrow.ipc.open_stream("steps.arrows")` reads what was written.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from servo.step import Step
from servo.types import DOF, FEATURES
from sim.robot import Robot
from tracking.evaluation import atomic

STREAM, TABLE = "steps.arrows", "steps.parquet"
TWIST_UNITS = ("m_s", "m_s", "m_s", "rad_s", "rad_s", "rad_s")
FEATURE_NAMES = ("xn", "yn", "an", "theta_rad")
"""xn, yn and an are in the unit of the scenario's features.scaling; rates of change per second."""
REAL, WHOLE, FLAG, TEXT = pa.float64(), pa.int64(), pa.bool_(), pa.string()
TIMED = "seconds_"
"""Columns that begin so hold wall-clock time; all others repeat bit for bit with the seed."""
CELL, COLUMN_OF_BATCH = 16, 320
"""Room of a value in stream and table, and of a column's part of a batch, never less [bytes]."""
SPARE = 1 << 20
"""Room for report and plots, which are written when the rows are [bytes]."""


@dataclass(frozen=True, slots=True)
class Column:
    """One column: its name (with unit), what it means, and how it is read from a step."""

    name: str
    meaning: str
    of: Callable[[Step], Any]
    type: pa.DataType = REAL


def columns(joints: tuple[str, ...], units: tuple[str, ...]) -> list[Column]:
    """All columns, in order, for a robot with these joints and their units, m or rad."""
    return [
        Column("frame", "number of the frame", lambda s: s.frame.index, WHOLE),
        Column("time_s", "simulated time", lambda s: s.frame.time),
        Column("fresh", "whether the camera delivered this frame", lambda s: s.frame.fresh, FLAG),
        *_state_columns(),
        *_feature_columns(),
        *_vector("command", "asked for by this frame", lambda s: s.command.twist, DOF, TWIST_UNITS),
        *_vector("acting", "asked for until the next", lambda s: s.twist_acting, DOF, TWIST_UNITS),
        *_vector("measured", "camera's mean twist since the last frame",
                 lambda s: s.twist_measured, DOF, TWIST_UNITS),
        *_vector("joint", "position", lambda s: s.joints, joints, units),
        *_vector("rate", "velocity", lambda s: s.rates, joints, tuple(f"{u}_s" for u in units)),
        *_vector("margin", "way to the nearer limit, inf where there is none",
                 lambda s: s.margins, joints, units),
        Column("tilt_rad", "optical axis against straight down", lambda s: s.tilt),
        Column("mode", "what the controller does", lambda s: s.command.mode.name, TEXT),
        Column("command_saturated", "a limit of speed or acceleration changed it",
               lambda s: s.command.saturated, FLAG),
        Column("joint_limited", "a joint slowed the motion", lambda s: s.limited, FLAG),
        Column("visible", "fraction of target seen", lambda s: s.truth.visible),
        *(_seconds_column(stage) for stage in ("render", "track", "control", "physics")),
    ]  # fmt: skip


def _state_columns() -> Iterator[Column]:
    for who, meaning, of in (
        ("true", "truth", lambda s: s.true_state),
        ("estimated", "estimate", lambda s: s.estimate.state),
    ):
        for part, unit in (("x", "_px"), ("y", "_px"), ("theta", "_rad"), ("scale", "")):
            yield Column(f"{who}_{part}{unit}", f"{meaning}: {part}", _part(of, part))
    sd: Callable[[Step], Any] = lambda s: np.sqrt(np.diag(s.estimate.covariance))  # noqa: E731
    yield from _vector(
        "sd", "standard deviation of the estimate", sd, ("x_px", "y_px", "theta_rad", "ln_scale")
    )
    yield Column("goal_x_px", "goal: x", lambda s: s.goal[0])
    yield Column("goal_y_px", "goal: y", lambda s: s.goal[1])
    yield Column("servo_error_px", "true centre to goal", lambda s: s.servo_error)
    yield Column("tracking_error_px", "estimated to true centre", lambda s: s.tracking_error)
    yield Column(
        "distance", "Bhattacharyya distance of the estimate, 0..1", lambda s: s.estimate.distance
    )
    yield Column("status", "LOCKED, UNSURE or LOST", lambda s: s.estimate.status.name, TEXT)
    yield Column("ess", "effective sample size", lambda s: s.estimate.ess)
    yield Column("evaluations", "histograms evaluated", lambda s: s.estimate.evaluations, WHOLE)


def _feature_columns() -> Iterator[Column]:
    for name, meaning, of in (
        ("feature", "as seen", lambda s: s.command.features),
        ("error", "e = s - s*", lambda s: s.command.error),
        ("error_ahead", "e when the command acts", lambda s: s.command.outlook.error),
        ("motion_measured", "target's de/dt: raw", lambda s: s.command.target_motion_measured),
        ("motion_estimated", "target's de/dt: estimated", lambda s: s.command.target_motion),
        ("motion_true", "target's de/dt: true", lambda s: s.target_motion_true),
    ):
        yield from _vector(name, meaning, of, FEATURE_NAMES)
    yield from _vector(
        "innovation",
        "of the estimator's filter: measured minus expected",
        lambda s: s.command.outlook.innovation,
        FEATURE_NAMES,
    )
    yield from _vector(
        "nis", "innovation squared over its variance", lambda s: s.command.outlook.nis, FEATURES
    )


def _part(of: Callable[[Step], Any], part: str) -> Callable[[Step], Any]:
    return lambda s: getattr(of(s), part)


def _vector(
    prefix: str,
    meaning: str,
    of: Callable[[Step], Any],
    names: tuple[str, ...],
    units: tuple[str, ...] | None = None,
) -> Iterator[Column]:
    for i, name in enumerate(names):
        unit = f"_{units[i]}" if units else ""
        yield Column(f"{prefix}_{name}{unit}", f"{meaning}: {name}", lambda s, i=i: of(s)[i])


def _seconds_column(stage: str) -> Column:
    return Column(TIMED + stage, f"wall-clock time: {stage}", lambda s: getattr(s.seconds, stage))


class StepsTable:
    """Writes the table of one run into a folder."""

    def __init__(self, folder: Path, robot: Robot, rows_at_once: int, rows: int) -> None:
        """Reserve room for all rows on the disk, so that nothing else can take it.

        Args:
            folder: Where to write.
            robot: Whose joints are columns.
            rows_at_once: Rows that are written together.
            rows: Rows of the whole run.

        Raises:
            FileExistsError: Somebody writes a run into this folder already.
            OSError: The disk has no room for the rows.
        """
        self._folder, self._at_once = folder, rows_at_once
        self._columns = columns(robot.names, robot.units)
        self._rows: list[dict[str, Any]] = []
        fields = [pa.field(c.name, c.type, metadata={"meaning": c.meaning}) for c in self._columns]
        self._schema = pa.schema(fields)
        self._file = (folder / STREAM).open("xb")
        width = len(self._columns)
        batches = 1 + rows / rows_at_once
        _reserve(self._file, round(width * (CELL * rows + COLUMN_OF_BATCH * batches)) + SPARE)
        self._stream = pa.ipc.new_stream(self._file, self._schema)

    def add(self, step: Step) -> None:
        """Append a row."""
        self._rows.append({c.name: c.of(step) for c in self._columns})
        if len(self._rows) >= self._at_once:
            self._flush()

    def close(self) -> None:
        """Turn the stream into the table; where the disk refuses that, the stream stays."""
        self._flush()
        self._stream.close()
        self._file.truncate()
        self._file.close()
        with pa.ipc.open_stream(str(self._folder / STREAM)) as reader:
            whole = reader.read_all()
        with atomic.writing(self._folder, TABLE) as file:
            pq.write_table(whole, file)
        (self._folder / STREAM).unlink()

    def _flush(self) -> None:
        if self._rows:
            self._stream.write_batch(pa.RecordBatch.from_pylist(self._rows, schema=self._schema))
            self._file.flush()
            self._rows = []


def _reserve(file: BinaryIO, size: int) -> None:
    """Take room on the disk [bytes]; a reader takes the zeros at the end for the stream's end."""
    if hasattr(os, "posix_fallocate"):
        os.posix_fallocate(file.fileno(), 0, size)
