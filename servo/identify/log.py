"""A robot's log: its commands, its motion, and the arrival times of its pictures.

Columns are named as in the file steps.parquet of a run; a row must have its time_s, and may leave
any other cell empty.
"""

import io
import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet as pq

from servo.mistake import Mistake, as_mistake, check_rules
from sim.files import reading
from sim.types import Array

COMMAND = re.compile("command_(.+)_(m|rad)_s")
STAMPS = ("time_s", "asked_s", "arrived_s")
PICTURES = ("age_s", "picture", "frame", "decided")
"""Columns of a run's own log: when each command's picture was taken, and whether it was used."""
SHORTEST = 2.0
"""Shortest log [s]; a shorter one has too few movements."""
LONGEST = 600.0
"""Longest log [s]; a longer one adds little and takes long."""
FEWEST = 40
"""Least number of positions for delay, lag, play, gain and friction."""
SPARSEST = 0.1
"""Largest interval of rows [s]; commands between rarer rows are missing."""
LEAST = 1e-9
"""Least change of a position or rate that counts as motion [m, rad, m/s, rad/s]."""
ROUNDING = 4 * float(np.finfo(np.float32).eps)
"""Largest range of a constant that was rounded to single precision, relative to its size."""
FARTHEST = 1e12
"""Largest plausible number in any unit; squares of larger ones overflow."""
JUMP = 2.0, 5.0
"""A position jumps if it changes by more than the sum of two terms: this factor times the distance
at the fastest command, and this factor times the 90 % quantile of all changes."""
LATEST = 1.0
"""Largest distance of a picture or a command from its row [s] on the same clock."""
SLOW = 0.25
"""Shortest wait for a picture that is unusual for a camera [s]."""
COARSE = 2.5e-3
"""Largest range of waits that stamps rounded to 1 ms can explain [s]."""
DEPENDENT = 0.7
"""Correlation of consecutive waits above which they are not independent."""
TAIL = 8.0
"""Largest range of uniform waits over their interquartile range: 2 for a uniform distribution, 7
for 10^5 pictures with a normal one."""
OFF_WHOLE = 0.2
"""Largest distance of a regular interval from a multiple of the median interval, relative to it."""
REGULAR = 0.9
"""Least share of regular intervals in a log whose missing rows can be counted."""
FINEST = 5e-3
"""Interval over which faster positions are averaged [s]; delay and lag are never known better than
to 2 ms."""
BRIDGED = 10
"""Longest gap, in intervals of rows, in which the time of a change of command is estimated."""
LARGEST = 1 << 30
"""Largest size of a log [bytes]."""
NAMED = 12
"""Most columns of a log that a message lists."""
COLUMNS = (
    "command_NAME_m_s and joint_NAME_m, encoder_NAME_m or measured_NAME_m_s (_rad in place of _m "
    "for angles)"
)
"""Columns that a log needs beside time_s."""


@dataclass(frozen=True, slots=True)
class Series:
    """Numbers (n,) of a robot's log with their times (n,) [s], in order of time."""

    times: Array
    """Stamps (n,) [s]."""
    values: Array
    """Numbers (n,)."""

    @property
    def varies(self) -> bool:
        """True if two of the numbers differ by more than 1e-9, and by more than rounding to single
        precision explains.
        """
        rounding = ROUNDING * np.abs(self.values).max(initial=0.0)
        return len(self.values) > 1 and bool(np.ptp(self.values) > max(LEAST, rounding))


@dataclass(frozen=True, slots=True)
class LogChannel:
    """The log of a joint, or of a component of the camera's twist: commanded rates [m/s, rad/s],
    positions and encoder readings [m, rad] over time.
    """

    name: str
    unit: str
    """Unit of its positions: m or rad."""
    command: Series
    """Commanded rates, each held until the next one [m/s, rad/s]."""
    moved: Series
    """Positions [m, rad]: those of the joint, else of its encoder, else the integral of measured
    rates."""
    encoder: Series
    """Readings of the motor's encoder [m, rad]; empty if there are none."""
    shows_play: bool
    """True for a joint whose positions were measured behind the gear."""


@dataclass(frozen=True, slots=True)
class Log:
    """The contents of a robot's log: commands and motion of each channel (a joint, or a component
    of the camera's twist), the times that pictures took to arrive [s], and what is missing, unused
    or doubtful in it.
    """

    channels: list[LogChannel]
    """Channels with a command that varies and a position that varies."""
    transport: Array
    """Times from pictures' stamps to their arrivals (n,) [s], wrong by a constant if `clock` says
    so; empty if unknown."""
    unused: list[str]
    """Names of columns that are not used here, or are empty."""
    asked: list[tuple[str, str]]
    """Name and unit (m or rad) of each channel with a command, whether it moved or not."""
    interval: float
    """Median interval of the rows [s]."""
    missing: float
    """Share of the rows that are missing, by this interval."""
    clock: str
    """A sentence about unreliable arrival times, or an empty text."""
    still: list[str]
    """Names of channels whose command varies and whose positions do not."""

    @property
    def uncertain(self) -> float:
        """Mean error of the time of a command because rows of the log are missing [s]."""
        return self.missing * self.interval


def read(path: Path) -> Log:
    """Read a robot's log: CSV, Parquet, or MCAP with JSON messages, such as /step of a run.

    Raises:
        Mistake: The file cannot be read; its column time_s is missing, does not increase, or spans
            less than 2 s or more than 600 s; asked_s is of another clock than time_s; a used column
            has texts, numbers above 1e12 or positions that jump; no channel has a command and
            positions that vary; or one that has them has too few positions, or too far apart.
    """
    return log_of(table_in(path), path)


def log_of(table: pa.Table, path: Path) -> Log:
    """Return the robot's log that a table of columns holds, such as time_s and command_NAME_rad_s.

    Args:
        table: The table.
        path: The table's file, for messages.

    Raises:
        Mistake: The log cannot be used, for one of the reasons that `read` names.
    """
    names = table.column_names
    commands = [found.groups() for found in map(COMMAND.fullmatch, names) if found]
    used = {*STAMPS, *PICTURES, *(part for each in commands for part in _parts(*each))}
    columns = {
        name: numbers_in(table, name, path)
        for name, column in zip(names, table.columns, strict=True)
        if name in used and (name == "time_s" or not pa.types.is_null(column.type))
    }
    if "time_s" not in columns:
        has = listed(names, NAMED) or "none"
        raise Mistake(
            f"{path}: this log has no column time_s; a log needs time_s, {COLUMNS}; this one "
            f"has {has}"
        )
    time = columns["time_s"]
    if not (len(time) and np.isfinite(time).all() and np.all(time[1:] > time[:-1])):
        raise Mistake(
            f"{path}: time_s is empty or does not increase from row to row: sort or correct "
            "the rows"
        )
    span = round(float(time[-1]) - float(time[0]), 3)
    if not SHORTEST <= span <= LONGEST:
        raise Mistake(
            f"{path}: this log is {span:.6g} s long: record {SHORTEST:g} to {LONGEST:g} s"
        )
    lost = _lost(time)
    asked, waited = _pictures(columns, lost)
    new = np.isfinite(asked) & (np.diff(asked, prepend=np.nan) != 0)  # rows with a new command
    late = float(np.median((asked - time)[new])) if new.any() else 0.0
    if abs(late) > LATEST:
        raise Mistake(
            f"{path}: asked_s is {late:.6g} s after time_s: record both with the same clock"
        )
    clock, transport = _arrivals(waited, is_with_commands=late < 0)
    channels = [
        _channel(columns, asked, name, unit, path)
        for name, unit in commands
        if f"command_{name}_{unit}_s" in columns
    ]
    moving = [c for c in channels if c.command.varies and c.moved.varies]
    _check_enough(moving, path)
    return Log(
        moving,
        transport,
        [name for name in names if name not in columns],
        [(c.name, c.unit) for c in channels],
        float(np.median(np.diff(time))),
        float(lost.sum() / (lost.sum() + len(time))),
        clock,
        [c.name for c in channels if c.command.varies and len(c.moved.values) and c not in moving],
    )


def _parts(name: str, unit: str) -> tuple[str, str, str, str]:
    """Return the names of a channel's four columns: commanded rate, measured rate, joint position
    and encoder position.
    """
    of = f"{name}_{unit}"
    return f"command_{of}_s", f"measured_{of}_s", f"joint_{of}", f"encoder_{of}"


def _check_enough(moving: Sequence[LogChannel], path: Path) -> None:
    """Check that a log has a channel that moves, and that each one that moves has enough positions,
    near enough to each other.

    Raises:
        Mistake: It has not.
    """
    for channel in moving:
        positions = len(channel.moved.values)
        # Stamps of 10 Hz differ by 0.1 s and a rounding error.
        interval = round(float(np.median(np.diff(channel.moved.times))), 3)
        check_rules(
            (
                positions < FEWEST,
                f"{path}: this log has {positions} positions of {channel.name}; record at least "
                f"{FEWEST}, and more than one movement",
            ),
            (
                interval > SPARSEST,
                f"{path}: the positions of {channel.name} are {interval:.3g} s apart, too far for "
                f"delay and lag: record one every {SPARSEST:g} s or more often",
            ),
        )
    if not moving:
        raise Mistake(
            f"{path}: no joint in this log has commanded rates and positions that change; a "
            f"log needs columns {COLUMNS}"
        )


def listed(names: Sequence[str], most: int) -> str:
    """Return the first `most` names with commas between them, and the number of those left out: "a,
    b and 3 more".
    """
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more


def table_in(path: Path) -> pa.Table:
    """Return the rows of a robot's log as an Arrow table. A last line of a CSV file without line
    end is left out, because it may have lost some of its digits.

    Args:
        path: A file .csv, .parquet or .mcap; of an MCAP file, the JSON messages that have a time_s.

    Raises:
        Mistake: The file cannot be read, or is of another type.
    """
    with as_mistake():
        data = reading.content(path, "log", LARGEST)
    try:
        match path.suffix.lower():
            case ".csv":
                # Messages about a row have its number only if one thread reads all rows.
                options = pyarrow.csv.ReadOptions(use_threads=False)
                whole = data[: 1 + data.rfind(b"\n")] or data
                return pyarrow.csv.read_csv(io.BytesIO(whole), read_options=options)
            case ".parquet":
                return pq.read_table(pa.BufferReader(data), page_checksum_verification=True)
            case ".mcap":
                return pa.Table.from_pylist(_messages(data))
            case _:
                raise Mistake(
                    f"{path}: this is no log: give a file that ends in .csv, .parquet or .mcap"
                )
    except (pa.ArrowException, ValueError) as error:
        if isinstance(error, Mistake):
            raise
        text = " ".join(str(error).split())
        raise Mistake(
            f"{path}: cannot read this log: {text}; correct it, or save it again"
        ) from error


def numbers_in(table: pa.Table, name: str, path: Path) -> Array:
    """Return a column of a robot's log (n,); an empty cell is nan.

    Args:
        table: The log's rows.
        name: Name of the column.
        path: The log's file, for messages.

    Raises:
        Mistake: There is no such column, or more than one, or it holds something else than numbers.
    """
    try:
        return np.asarray(table[name].cast(pa.float64()), np.float64)
    except (pa.ArrowException, KeyError) as error:
        raise Mistake(
            f"{path}: {name} is not one column of numbers: {error.args[0]}; correct this column"
        ) from error


def _messages(data: bytes) -> list[dict[str, object]]:
    """Return the JSON messages of a log in MCAP that have a time_s.

    Raises:
        Mistake: The package mcap is not installed.
        ValueError: The file is damaged, or a message is not valid JSON.
    """
    try:
        from mcap.exceptions import McapError
        from mcap.reader import make_reader
    except ImportError:
        raise Mistake("a log in MCAP needs the package mcap: install servobench[ros]") from None
    try:
        found = list(make_reader(io.BytesIO(data)).iter_messages())
    except McapError as error:
        raise ValueError(str(error) or "it ends too early") from error
    rows = [json.loads(m.data) for _, channel, m in found if channel.message_encoding == "json"]
    return [row for row in rows if isinstance(row, dict) and "time_s" in row]


def _lost(time: Array) -> Array:
    """Return the number of rows missing before each row (n,).

    It is 0 for all rows if too many come irregularly, such as those of several sources.
    """
    intervals = np.diff(time) / np.median(np.diff(time))
    whole = np.rint(intervals)
    if np.mean(np.abs(intervals - whole) < OFF_WHOLE) < REGULAR:
        return np.zeros(len(time))
    return np.append(0.0, np.maximum(whole - 1, 0.0))


def _pictures(columns: dict[str, Array], lost: Array) -> tuple[Array, Array]:
    """Return the stamps of the commands (n,) [s], nan if a row has none, and the time from each
    row's stamp to its picture's arrival (n,) [s].

    A command after missing rows came with one of them or with its own row: the middle of these
    stamps is right on average.
    """
    time = columns["time_s"]
    if set(PICTURES) <= columns.keys():
        at = np.searchsorted(columns["frame"], columns["picture"]).clip(max=len(time) - 1)
        is_there = columns["frame"][at] == columns["picture"]
        decided = (columns["decided"] > 0) & is_there
        made = np.where(decided, time[at] + columns["age_s"], np.nan)
        return made, np.where(decided, columns["age_s"], np.nan)
    waited = columns.get("arrived_s", np.full(len(time), np.nan)) - time
    since = np.where(lost < BRIDGED, lost * np.diff(time, prepend=time[0]) / (lost + 1), 0.0)
    return columns.get("asked_s", time - since / 2), waited


def _arrivals(waited: Array, *, is_with_commands: bool) -> tuple[str, Array]:
    """Return a sentence about unreliable waits for pictures, and the usable waits (k,) [s].

    A clock with a constant offset leaves the differences of the waits, which show jitter. It also
    leaves the sum of wait and delay if the commands have the same clock: their errors cancel.

    Args:
        waited: Times (n,) from each row's stamp to its picture's arrival [s]; nan for rows
            without an arrival.
        is_with_commands: True if commands precede their rows, as arrivals may.
    """
    found = waited[np.isfinite(waited)].clip(-FARTHEST, FARTHEST)
    if len(found) < FEWEST:
        few = f"only {len(found)} rows have arrived_s, and {FEWEST} are needed, so it is not used"
        return few if len(found) else "", np.empty(0)
    least, quarter, three, most = np.quantile(found, (0, 0.25, 0.75, 1))
    reach = most - least
    is_tailed = reach > TAIL * (three - quarter)
    arrive = f"pictures arrive {least:.6g} to {most:.6g} s after their stamps"
    cases = (
        (
            reach > COARSE and (is_tailed or np.corrcoef(found[1:], found[:-1])[0, 1] > DEPENDENT),
            f"{arrive}, half of them within {three - quarter:.3g} s; a simulated wait is uniform "
            "and independent of time, so arrived_s is not used: it has outliers, or its unit or "
            "clock is not that of time_s",
            np.empty(0),
        ),
        (0 <= least <= SLOW and most <= LATEST, "", found),
        (
            least > SLOW and most <= LATEST,
            f"pictures arrive {least:.3g} s after their stamps or later: is arrived_s on the clock "
            "of time_s?",
            found,
        ),
        (
            is_with_commands and least > -LATEST,
            f"{arrive}, so arrived_s and asked_s are of another clock than time_s; latency_ms is "
            "right if both are of the same",
            found,
        ),
        (
            True,
            f"{arrive}, so arrived_s is of another clock, and the shortest wait, which is unknown, "
            "is not in latency_ms",
            found - least,
        ),
    )
    return next((sentence, waits) for applies, sentence, waits in cases if applies)


def _channel(
    columns: dict[str, Array], asked: Array, name: str, unit: str, path: Path
) -> LogChannel:
    """Return the commands, positions and encoder readings of a channel.

    Args:
        columns: The log's columns (n,) by name.
        asked: Stamps of the commands (n,) [s].
        name: Name of the joint, or of the component of the twist.
        unit: Unit of the positions: m or rad.
        path: The file, for messages.

    Raises:
        Mistake: A number is too large, or a position jumps.
    """
    time = columns["time_s"]
    empty = np.full(len(time), np.nan)
    keys = _parts(name, unit)
    command, measured, joint, encoder = (columns.get(key, empty) for key in keys)
    fastest = float(np.nanmax(np.abs(command), initial=0.0))
    for key in keys:
        _check_positions(_series(time, columns.get(key, empty)), fastest, key, path)
    is_behind = bool(np.isfinite(joint).any())
    moved = next((each for each in (joint, encoder) if np.isfinite(each).any()), None)
    if moved is None:
        # Each is the mean since the last row that has one.
        known = np.isfinite(measured)
        since = np.diff(time[known], prepend=time[known][:1])
        moved = empty.copy()
        moved[known] = np.cumsum(since * measured[known])
    return LogChannel(
        name,
        unit,
        _series(asked, command),
        _averaged(_series(time, moved)),
        _series(time, encoder),
        is_behind,
    )


def _check_positions(series: Series, fastest: float, key: str, path: Path) -> None:
    """Check a column of a log for numbers that are too large and for jumps of a position.

    Args:
        series: The column.
        fastest: Largest commanded rate [m/s, rad/s]; the positions of an unmoved joint are unused.
        key: Name of the column.
        path: The file.

    Raises:
        Mistake: A number is too large, or a position or an encoder reading jumps by more than its
            commands explain.
    """
    far = np.flatnonzero(np.abs(series.values) > FARTHEST)
    if len(far):
        raise Mistake(
            f"{path}: at time_s = {series.times[far[0]]:.6g} {key} is {series.values[far[0]]:.3g}; "
            f"values should be from -{FARTHEST:g} to {FARTHEST:g}: correct or leave out this row"
        )
    jumps = np.diff(series.values)
    changes = np.abs(jumps)
    if key.endswith("_s") or len(changes) < FEWEST or not changes.any() or not fastest:
        return
    limits = JUMP[0] * fastest * np.diff(series.times)
    limits += JUMP[1] * np.quantile(changes[changes > 0], 0.9)
    # Of a spike both edges are jumps, and the row of the first is wrong.
    wrong = np.flatnonzero(changes > limits)
    if len(wrong):
        at = wrong[0]
        raise Mistake(
            f"{path}: {key} jumps by {jumps[at]:.3g}, to {series.values[at + 1]:.6g}, at time_s = "
            f"{series.times[at + 1]:.6g}, which no command explains: leave out the wrong rows"
        )


def _series(times: Array, values: Array) -> Series:
    """Return the finite values of a column with their stamps [s], in order of time."""
    known = np.flatnonzero(np.isfinite(times) & np.isfinite(values))
    order = known[np.argsort(times[known], kind="stable")]
    return Series(times[order], values[order])


def _averaged(series: Series) -> Series:
    """Return means over intervals of 5 ms of a series whose median interval is at most 2.5 ms; any
    other series, or one of fewer than 40 numbers, is returned unchanged.
    """
    times = series.times
    if len(times) < FEWEST or np.median(np.diff(times)) > FINEST / 2:
        return series
    first = np.flatnonzero(np.diff((times - times[0]) // FINEST, prepend=-1))
    counts = np.diff(first, append=len(times))
    means = [np.add.reduceat(each, first) / counts for each in (times, series.values)]
    return Series(*means)
