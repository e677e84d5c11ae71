"""The steps of a run as a table: one row a frame, column names with units, stored as Parquet.

While a run lasts its rows go to an Arrow stream beside the table, a second's worth at a time, so that a killed
run keeps them: `pyarrow.ipc.open_stream("steps.arrows").read_all()` reads what was written.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from servo.episode import Step
from servo.types import DOF, FEATURES

STREAM, TABLE = "steps.arrows", "steps.parquet"
TWIST_UNITS = ("m_s", "m_s", "m_s", "rad_s", "rad_s", "rad_s")
TIMED = "seconds_"
"""Columns that begin so hold wall-clock time; all others repeat bit for bit with the seed."""


@dataclass(frozen=True, slots=True)
class Column:
    """One column: its name (with unit), what it means, and how it is read from a step."""

    name: str
    meaning: str
    of: Callable[[Step], Any]


def columns(joint_names: tuple[str, ...]) -> list[Column]:
    """All columns, in order."""
    return [
        Column("frame", "number of the frame", lambda s: s.frame.index),
        Column("time_s", "simulated time", lambda s: s.frame.time),
        *_state_columns(),
        *_feature_columns(),
        *_vector("command", "asked for by this frame", lambda s: s.command.twist, DOF, TWIST_UNITS),
        *_vector("acting", "asked for until the next frame", lambda s: s.twist_acting, DOF, TWIST_UNITS),
        *_vector("measured", "camera's mean twist since the last frame",
                 lambda s: s.twist_measured, DOF, TWIST_UNITS),
        *_vector("joint", "position, m or rad", lambda s: s.joints, joint_names),
        *_vector("rate", "velocity, m/s or rad/s", lambda s: s.rates, joint_names),
        Column("tilt_rad", "optical axis against straight down", lambda s: s.tilt),
        Column("command_saturated", "a speed limit shortened the command", lambda s: s.command.saturated),
        Column("joint_limited", "a joint's limit or rate slowed the motion", lambda s: s.limited),
        Column("visible", "fraction of the target seen, null if not asked for", lambda s: s.truth.visible),
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
    yield from _vector("sd", "standard deviation of the estimate", sd, ("x_px", "y_px", "theta_rad", "ln_scale"))
    yield Column("goal_x_px", "goal: x", lambda s: s.goal[0])
    yield Column("goal_y_px", "goal: y", lambda s: s.goal[1])
    yield Column("servo_error_px", "true centre to goal", lambda s: s.servo_error)
    yield Column("tracking_error_px", "estimated to true centre", lambda s: s.tracking_error)
    yield Column("distance", "Bhattacharyya distance of the estimate, 0..1", lambda s: s.estimate.distance)
    yield Column("status", "LOCKED, UNSURE or LOST", lambda s: s.estimate.status.name)
    yield Column("ess", "effective sample size", lambda s: s.estimate.ess)
    yield Column("evaluations", "histograms evaluated", lambda s: s.estimate.evaluations)


def _feature_columns() -> Iterator[Column]:
    for name, meaning, of in (
        ("feature", "as seen", lambda s: s.command.features),
        ("error", "e = s - s*", lambda s: s.command.error),
        ("motion_measured", "de/dt of the target, plain difference", lambda s: s.command.target_motion_measured),
        ("motion_estimated", "de/dt of the target, estimated", lambda s: s.command.target_motion),
        ("motion_true", "de/dt of the target, true", lambda s: s.target_motion_true),
    ):  # fmt: skip
        yield from _vector(name, meaning, of, FEATURES)


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

    def __init__(self, folder: Path, joint_names: tuple[str, ...], rows_at_once: int) -> None:
        self._folder, self._columns, self._at_once = folder, columns(joint_names), rows_at_once
        self._rows: list[dict[str, Any]] = []
        types = {int: pa.int64(), bool: pa.bool_(), str: pa.string()}
        whole = {"frame": int, "evaluations": int, "status": str, "command_saturated": bool, "joint_limited": bool}
        self._schema = pa.schema(
            [
                pa.field(c.name, types.get(whole.get(c.name, float), pa.float64()), metadata={"meaning": c.meaning})
                for c in self._columns
            ]
        )
        self._file = (folder / STREAM).open("wb")
        self._stream = pa.ipc.new_stream(self._file, self._schema)

    def add(self, step: Step) -> None:
        """Append a row."""
        self._rows.append({c.name: c.of(step) for c in self._columns})
        if len(self._rows) >= self._at_once:
            self._flush()

    def close(self) -> None:
        """Turn the stream into the table."""
        self._flush()
        self._stream.close()
        self._file.close()
        with pa.ipc.open_stream(str(self._folder / STREAM)) as reader:
            pq.write_table(reader.read_all(), self._folder / TABLE)
        (self._folder / STREAM).unlink()

    def _flush(self) -> None:
        if self._rows:
            self._stream.write_batch(pa.RecordBatch.from_pylist(self._rows, schema=self._schema))
            self._file.flush()
            self._rows = []
