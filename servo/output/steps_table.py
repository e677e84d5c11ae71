"""The steps of a run as a Parquet table: a row for each frame, with units in the columns' names.

During the run, rows are written to an Arrow stream once a second of the wall clock, so that a
killed run keeps them: `pyarrow.ipc.open_stream("steps.arrows")` reads them.
"""

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from operator import attrgetter
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from servo.loop.episode import Episode
from servo.loop.step import Step
from servo.output.sinks import Timer
from servo.parts import FeatureSet
from servo.types import DOF
from sim.models.quaternion import quaternion_of
from sim.types import Array, Pose
from tracking.files import atomic
from tracking.types import State

STREAM = "steps.arrows"
TABLE = "steps.parquet"
FORMAT = 1
"""Format number in the schema's metadata; it increases by one when readers must change."""
STATE = ("x", "y", "theta", "scale")
STATE_UNITS = ("px", "px", "rad", "")
CORNERS = ("u0", "v0", "u1", "v1", "u2", "v2", "u3", "v3")
PIXELS = ("px",) * 8
POSE = ("x", "y", "z", "qw", "qx", "qy", "qz")
POSE_UNITS = ("m", "m", "m", "", "", "", "")
TWIST_UNITS = ("m_s", "m_s", "m_s", "rad_s", "rad_s", "rad_s")
"""Names and units of the numbers of a state, four corners, a pose and a twist."""
TIMED = "seconds_"
"""Prefix of columns of wall-clock time; all other columns are bit for bit the same when a run is
repeated, unless `RunConfig.repeats` is False."""
CELL = 16
COLUMN_OF_BATCH = 96
"""Space reserved for a value in stream and table, and for a column's description in a batch
[bytes]."""
BATCHES = 10
"""Batches for which space is reserved, in a simulated second: enough for a run at a tenth of real
time."""
SPARE = 1 << 19
"""Space for report and plots, which are written after the rows [bytes]."""


@dataclass(frozen=True, slots=True)
class Quantity:
    """One quantity in the table of a run's steps, such as the camera twist: its columns, their
    names, and a function (`of`) that returns their values for a step, one for each column.
    """

    name: str
    columns: list[pa.Field]
    """Names with units, types, and what they mean."""
    names: tuple[str, ...]
    """The names alone, which pyarrow would decode anew each time."""
    of: Callable[[Step], Sequence[object] | Array]
    """Function that returns the value of each column for a step."""


def quantities(
    features: FeatureSet, joints: tuple[str, ...], units: tuple[str, ...]
) -> list[Quantity]:
    """Return all columns of the table of a run's steps in order, grouped by quantity.

    Args:
        features: Features of the run.
        joints: Names of the robot's joints.
        units: Units of the joints, m or rad.
    """
    names = features.names
    own = tuple(map(ending, features.units))
    rates = tuple(map(ending_of_rate, features.units))
    motion = "target's own de/dt"
    pose = "true pose in the world"
    return [
        _single("frame", "number of the frame", lambda s: s.frame.index, "int64"),
        _single("time_s", "simulated time", lambda s: s.frame.time),
        _single(
            "fresh", "whether the camera delivered this frame", lambda s: s.frame.fresh, "bool"
        ),
        _single("picture", "frame that estimate and command are of", lambda s: s.picture, "int64"),
        _single("decided", "whether they are new in this row", lambda s: s.decided, "bool"),
        _single("age_s", "from that picture to its estimate", lambda s: s.age),
        _single(
            "skipped",
            "pictures that the tracker had no time for, so far",
            lambda s: s.skipped,
            "int64",
        ),
        _vector("true", "truth of this frame", lambda s: _state(s.true_state), STATE, STATE_UNITS),
        _vector(
            "true_of_picture",
            "truth of the picture that the estimate is of",
            lambda s: _state(s.true_state_estimated),
            STATE,
            STATE_UNITS,
        ),
        _vector("estimated", "estimate", lambda s: _state(s.estimate.state), STATE, STATE_UNITS),
        _vector(
            "sd",
            "standard deviation of the estimate",
            lambda s: np.sqrt(np.diag(s.estimate.covariance)),
            ("x", "y", "theta", "ln_scale"),
            STATE_UNITS,
        ),
        _vector("goal", "goal", lambda s: s.goal.centre, ("x", "y"), ("px", "px")),
        _single("servo_error_px", "true centre to goal", lambda s: s.servo_error),
        _single(
            "tracking_error_px",
            "estimated to true centre of its picture",
            lambda s: s.tracking_error,
        ),
        _single(
            "distance",
            "Distance of the estimate from the target's appearance, 0..1",
            lambda s: s.estimate.distance,
        ),
        _single("status", "LOCKED, UNSURE or LOST", lambda s: s.estimate.status.name, "string"),
        _single("ess", "effective sample size", lambda s: s.estimate.ess),
        _single("evaluations", "histograms evaluated", lambda s: s.estimate.evaluations, "int64"),
        _vector("true_corner", "truth", lambda s: s.truth.corners.ravel(), CORNERS, PIXELS),
        _vector(
            "estimated_corner",
            "estimate",
            lambda s: s.estimate.outline(s.region).ravel(),
            CORNERS,
            PIXELS,
        ),
        _vector("camera", pose, lambda s: _pose(s.truth.T_world_camera), POSE, POSE_UNITS),
        _vector("target", pose, lambda s: _pose(s.truth.T_world_target), POSE, POSE_UNITS),
        _vector("feature", "as seen", lambda s: s.features, names, own),
        _vector("error", "e = s - s*", lambda s: s.error, names, own),
        _vector("error_ahead", "e when the command acts", lambda s: s.prediction.error, names, own),
        _vector("motion_measured", f"{motion}, raw", lambda s: s.motion_measured, names, rates),
        _vector(
            "motion_estimated", f"{motion}, estimated", lambda s: s.prediction.motion, names, rates
        ),
        _vector("motion_true", f"{motion}, true", lambda s: s.target_motion_true, names, rates),
        _vector(
            "innovation",
            "measured minus expected error",
            lambda s: s.prediction.innovation,
            names,
            own,
        ),
        _vector("nis", "innovation squared over its variance", lambda s: s.prediction.nis, names),
        _vector("command", "asked for by this frame", lambda s: s.command.twist, DOF, TWIST_UNITS),
        _vector("acting", "asked for until the next", lambda s: s.twist_acting, DOF, TWIST_UNITS),
        _vector(
            "measured",
            "camera's mean twist since the last frame",
            lambda s: s.twist_measured,
            DOF,
            TWIST_UNITS,
        ),
        _vector("joint", "position", lambda s: s.joints, joints, units),
        _vector("rate", "velocity", lambda s: s.rates, joints, tuple(f"{u}_s" for u in units)),
        _vector(
            "margin",
            "distance to the nearer limit, inf where there is none",
            lambda s: s.margins,
            joints,
            units,
        ),
        _single("tilt_rad", "optical axis against straight down", lambda s: s.tilt),
        _single("mode", "what the controller does", lambda s: s.command.mode.name, "string"),
        _single("command_saturated", "a limit changed it", lambda s: s.command.saturated, "bool"),
        _single(
            "command_limits",
            "limits that changed it, where the controller names them",
            lambda s: ", ".join(s.command.limits),
            "string",
        ),
        _single(
            "command_violated",
            "those of them that it does not keep",
            lambda s: ", ".join(s.command.violated),
            "string",
        ),
        _single("joint_limited", "a joint slowed the motion", lambda s: s.limited, "bool"),
        _single(
            "joint_limits",
            "joints that slowed it, each with its limit",
            lambda s: ", ".join(s.joint_limits),
            "string",
        ),
        _single("visible", "fraction of target seen", lambda s: s.truth.visible),
        *(
            _single(TIMED + stage, f"wall-clock time: {stage}", attrgetter(f"seconds.{stage}"))
            for stage in ("render", "track", "control", "physics")
        ),
    ]


def quantities_of(episode: Episode) -> list[Quantity]:
    """Return all columns of the table of an episode's steps, grouped by quantity."""
    return quantities(episode.loop.features, episode.world.robot.names, episode.world.robot.units)


def _schema(found: Sequence[Quantity]) -> pa.Schema:
    every = [column for quantity in found for column in quantity.columns]
    return pa.schema(every, metadata={"format": str(FORMAT)})


def table_of(steps: Sequence[Step], found: Sequence[Quantity]) -> pa.Table:
    """Return an Arrow table with a row for each step of a run; `found` are its columns, grouped by
    quantity.
    """
    return pa.Table.from_pylist([row_of(step, found) for step in steps], schema=_schema(found))


def row_of(step: Step, found: Sequence[Quantity]) -> dict[str, object]:
    """Return the values of a step by name of the column; `found` are the columns, grouped by
    quantity.
    """
    return {
        column: value
        for quantity in found
        for column, value in zip(quantity.names, quantity.of(step), strict=True)
    }


def _state(state: State) -> tuple[float, ...]:
    return state.x, state.y, state.theta, state.scale


def _pose(pose: Pose) -> Array:
    """Return a pose as position [m] and unit quaternion with w first (7,)."""
    return np.append(pose.translation, quaternion_of(pose.rotation))


def ending(unit: str) -> str:
    """Return the part of a column's name that states its unit: "rad" for "rad", and "" for "1", a
    number without unit.
    """
    return "" if unit == "1" else unit


def ending_of_rate(unit: str) -> str:
    """Return the part of a column's name that states the unit of a rate of change of a quantity
    with unit `unit`: "rad_s" for "rad", "per_s" for "1".
    """
    return "per_s" if unit == "1" else f"{unit}_s"


def _single(
    name: str, meaning: str, of: Callable[[Step], object], kind: str = "float64"
) -> Quantity:
    return Quantity(name, [_column(name, meaning, kind)], (name,), lambda s: (of(s),))


def _column(name: str, meaning: str, kind: str = "float64") -> pa.Field:
    return pa.field(name, kind, metadata={"meaning": meaning})


def _vector(
    prefix: str,
    meaning: str,
    of: Callable[[Step], Sequence[object] | Array],
    names: tuple[str, ...],
    units: tuple[str, ...] = (),
) -> Quantity:
    endings = [f"_{unit}" if unit else "" for unit in units] or [""] * len(names)
    found = [
        _column(f"{prefix}_{name}{ending}", f"{meaning}: {name}")
        for name, ending in zip(names, endings, strict=True)
    ]
    return Quantity(prefix, found, tuple(column.name for column in found), of)


class StepsTable:
    """Writer of the table of one run's steps in a folder: into the Arrow stream steps.arrows as
    they come, and at the end into steps.parquet. Space on the disk for all rows of the episode is
    reserved at the beginning, if the operating system can do this.
    """

    def __init__(self, folder: Path, episode: Episode) -> None:
        """Open the stream in a folder, and reserve space on the disk for all rows of the episode,
        if the operating system can do this.

        Raises:
            FileExistsError: The folder has a stream already: another run is writing into it.
            OSError: The stream cannot be written, or the disk has no space for the rows.
        """
        self._folder = folder
        self._timer = Timer()
        self._quantities = quantities_of(episode)
        self._rows: list[dict[str, object]] = []
        every = self._schema = _schema(self._quantities)
        self._file = (folder / STREAM).open("xb")
        self._stream = pa.ipc.new_stream(self._file, self._schema)
        # An empty batch writes the schema: a stream that is killed at once can be read, too.
        self._stream.write_batch(pa.RecordBatch.from_pylist([], schema=self._schema))
        self._file.flush()
        batches = 1 + BATCHES * episode.frames / episode.scenario.camera.rate
        size = round(len(every) * (CELL * episode.frames + COLUMN_OF_BATCH * batches)) + SPARE
        if hasattr(os, "posix_fallocate"):  # readers interpret the zeros as the stream's end
            os.posix_fallocate(self._file.fileno(), 0, size)

    def add(self, step: Step) -> None:
        """Append a step as a row; rows are written to the disk about once a second of the wall
        clock.

        Raises:
            ValueError: A value of the step has another length than its columns in the table.
            OSError: The rows cannot be written.
        """
        self._rows.append(row_of(step, self._quantities))
        if self._timer.due():
            self._flush()

    def close(self) -> None:
        """Write all rows to steps.parquet, and delete the stream steps.arrows, which stays if the
        table cannot be written.

        Raises:
            OSError: The table cannot be written.
        """
        self._flush()
        self._stream.close()
        self._file.truncate()
        self._file.close()
        with pa.ipc.open_stream(str(self._folder / STREAM)) as reader:
            whole = reader.read_all()
        with atomic.writing(self._folder, TABLE) as file:
            pq.write_table(whole, file, write_page_checksum=True)
        (self._folder / STREAM).unlink()

    def _flush(self) -> None:
        if self._rows:
            self._stream.write_batch(pa.RecordBatch.from_pylist(self._rows, schema=self._schema))
            self._file.flush()
            self._rows = []
