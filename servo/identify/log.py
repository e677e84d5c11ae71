"""A robot's log: what was asked of it, how it moved, and when pictures arrived.

Columns have the names of those of steps.parquet; a row may leave any of them empty but `time_s`.
"""

import io
import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet as pq

from servo.mistake import Mistake
from sim.files import reading
from sim.types import Array

COMMAND = re.compile("command_(.+)_(m|rad)_s")
POSITION = re.compile("command_(.+)_(m|rad)")
STAMPS = ("time_s", "asked_s", "arrived_s")
PICTURES = ("age_s", "picture", "frame", "decided")
"""Columns of a run's own log that say when pictures were made, and which were used."""
SHORTEST = 2.0
"""A shorter log has too few movements [s]."""
LONGEST = 600.0
"""A longer one takes long, and adds little [s]."""
FEWEST = 40
"""Fewer positions cannot show delay, lag, play, gain and friction."""
SPARSEST = 0.1
"""Rows that come less often [s] miss the commands between them."""
LEAST = 1e-9
"""A motion or a rate that changes by less [m, rad, m/s, rad/s] is none."""
FARTHEST = 1e12
"""A larger number [m, rad, m/s, rad/s] is none of a robot, whatever its unit."""
JUMP = 2.0, 5.0
"""A position jumps that changes by more than so many times the way of the fastest command, and so
many times what nine of ten changes are less than."""
LATEST = 1.0
"""A picture or a command that is farther from its row [s] has the stamp of another clock."""
SLOW = 0.25
"""A camera's pictures come earlier [s] as a rule."""
DRIFTS = 6.0
"""Standard deviations of a trend of the arrivals that is none of chance, and"""
LEAST_DRIFT = 1e-3
"""the least one [s] that is a clock's."""
COARSE = 2.5e-3
"""Waits that differ by less [s] may do so because stamps are rounded to 1 ms."""
PIECES = 20
"""Most parts of a log in which the usual wait should be the same."""
SWINGS = 0.7
"""Correlation of each wait with the one before that independent waits do not reach."""
TAIL = 8.0
"""Waits that reach over so many times their middle half are not uniform: a uniform distribution
has 2, a normal one 7 in 10^5 pictures."""
OFF_WHOLE = 0.2
"""An interval of rows is regular if it is less than this off a multiple of the usual interval."""
REGULAR = 0.9
"""Rows are looked for that are missing if at least this part of the intervals is regular."""
FINEST = 5e-3
"""Positions that come faster [s] are averaged: delay and lag are known to 2 ms at best."""
BRIDGED = 10
"""In a longer gap, of so many intervals, nothing is known of the commands."""
LARGEST = 1 << 30
"""Most bytes of a log."""
NAMED = 12
"""Most columns of a log that are named in a message."""
COLUMNS = (
    "command_NAME_m_s and joint_NAME_m, encoder_NAME_m or measured_NAME_m_s (_rad in place of _m "
    "for angles)"
)
"""Those that a log needs beside time_s."""
NEEDS = "a log in MCAP needs the package mcap: install servobench[ros]"


@dataclass(frozen=True, slots=True)
class Series:
    """Numbers (n,) and their stamps, in order."""

    times: Array
    """[s]."""
    values: Array

    @property
    def varies(self) -> bool:
        """True where the values are not all the same."""
        return len(self.values) > 1 and bool(np.ptp(self.values) > LEAST)


@dataclass(frozen=True, slots=True)
class Channel:
    """One direction of motion: a joint, or a part of the camera's twist."""

    name: str
    unit: str
    """Of its positions: m or rad."""
    command: Series
    """Rates asked for, each held until the next one [m/s, rad/s]."""
    moved: Series
    """Positions [m, rad]; of a twist, its sum over time."""
    encoder: Series
    """Readings of the motor's encoder [m, rad]; empty where there are none."""
    shows_play: bool
    """True for a joint whose positions were measured behind the gear."""


@dataclass(frozen=True, slots=True)
class Log:
    """What was read from a log."""

    channels: list[Channel]
    """Those that were asked to move, and moved."""
    transport: Array
    """From each picture's stamp to its arrival (n,) [s]; empty where it is not known."""
    unused: list[str]
    """Columns that have no meaning here, or no numbers."""
    asked: list[tuple[str, str]]
    """Name and unit (m or rad) of all that has a command, moved or not."""
    interval: float
    """The usual one of its rows [s]."""
    missing: float
    """Part of the rows that are missing, by this interval."""
    cut: str
    """What was left out at the end, in a sentence; empty where nothing was."""
    clock: str
    """What is wrong with the arrivals, in a sentence; empty where nothing is."""
    still: list[str]
    """Names of what was asked to move, and whose positions stay the same."""

    @property
    def uncertain(self) -> float:
        """So far the stamp of a command in a gap is from the true one, on average [s]."""
        return self.missing * self.interval


def read(path: Path) -> Log:
    """Read a log: CSV, Parquet, or MCAP with JSON messages, such as /step of our own.

    Raises:
        Mistake: It cannot be read, its columns contradict what they should have, or nothing in it
            was asked to move and moved.
    """
    names, columns, cut = _columns(path)
    time = columns.get("time_s", np.empty(0))
    if not (len(time) and np.isfinite(time).all() and np.all(time[1:] > time[:-1])):
        raise Mistake(f"{path}: time_s should increase from row to row")
    span = round(float(time[-1]) - float(time[0]), 3)
    if not SHORTEST <= span <= LONGEST:
        length = f"{span:.3g} s long; {SHORTEST:g} to {LONGEST:g} s are needed"
        raise Mistake(f"{path}: this log is {length}")
    lost = _lost(time)
    asked, waited = _pictures(columns, lost)
    late = _late(time, asked)
    if abs(late) > LATEST:
        raise Mistake(f"{path}: asked_s is {late:.6g} s after time_s; they should have one clock")
    clock, transport = _arrivals(waited, is_with_commands=late < 0)
    named = [found.groups() for name in columns if (found := COMMAND.fullmatch(name))]
    for name, unit in named:
        _check_positions(columns, name, unit, path)
    channels = [_channel(columns, asked, name, unit) for name, unit in named]
    moving = [c for c in channels if c.command.varies and c.moved.varies]
    _check_enough(moving, names, path)
    used = {*STAMPS, *PICTURES, *(of for each in named for of in _parts(*each))}
    return Log(
        moving,
        transport,
        [name for name in names if name not in used & columns.keys()],
        [(c.name, c.unit) for c in channels],
        float(np.median(np.diff(time))),
        float(lost.sum() / (lost.sum() + len(time))),
        cut,
        clock,
        [c.name for c in channels if c.command.varies and len(c.moved.values) and c not in moving],
    )


def _columns(path: Path) -> tuple[list[str], dict[str, Array], str]:
    """Return the names of all columns, those of numbers, and a sentence about what was cut."""
    try:
        table, cut = _table(path)
        columns = _numbers(table)
    except (pa.ArrowException, ValueError) as error:
        if isinstance(error, Mistake) or str(error).startswith(str(path)):
            raise Mistake(str(error)) from None
        kind = path.suffix[1:].upper()
        raise Mistake(f"{path}: cannot read this log: it is damaged, or no {kind} file") from error
    names = table.column_names
    if "time_s" not in names:
        has = listed(names, NAMED) or "none"
        raise Mistake(
            f"{path}: this log has no column time_s; it needs time_s, {COLUMNS}; it has {has}"
        )
    used = {*STAMPS}
    for found in filter(None, map(COMMAND.fullmatch, names)):
        used |= {*_parts(*found.groups())}
    for name, column in zip(names, table.columns, strict=True):
        if names.count(name) > 1:
            raise Mistake(f"{path}: the column {name} is there {names.count(name)} times")
        if name in used - columns.keys() and not pa.types.is_null(column.type):
            raise Mistake(f"{path}: {name} should have numbers; {_no_number(column)}")
    return names, columns, cut


def _parts(name: str, unit: str) -> tuple[str, str, str, str]:
    """Return the columns of a joint, or of a part of a twist: rates first."""
    of = f"{name}_{unit}"
    return f"command_{of}_s", f"measured_{of}_s", f"joint_{of}", f"encoder_{of}"


def _check_enough(moving: Sequence[Channel], names: Sequence[str], path: Path) -> None:
    """Refuse a log that has nothing that moves, or too little of it."""
    for channel in moving:
        positions = len(channel.moved.values)
        if positions < FEWEST:
            raise Mistake(
                f"{path}: this log has {positions} positions of {channel.name}; at least {FEWEST} "
                "are needed, and more than one movement"
            )
        # Stamps of 10 Hz differ by 0.1 s and a rounding error.
        if (interval := round(float(np.median(np.diff(channel.moved.times))), 3)) > SPARSEST:
            raise Mistake(
                f"{path}: the positions of {channel.name} come each {interval:.3g} s; delay and "
                f"lag need one each {SPARSEST:g} s at least"
            )
    if moving:
        return
    if not any(map(COMMAND.fullmatch, names)):
        for name in filter(POSITION.fullmatch, names):
            raise Mistake(f"{path}: {name} has positions by its name; rates are needed, {name}_s")
    raise Mistake(
        f"{path}: nothing in this log was asked to move and moved; it needs columns {COLUMNS}"
    )


def listed(names: Sequence[str], most: int) -> str:
    """Names with commas between them, of which the last may only be counted."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more


def _table(path: Path) -> tuple[pa.Table, str]:
    """Return a log's rows, and a sentence about a last line that was cut."""
    data = reading.content(path, "log", LARGEST)
    match path.suffix.lower():
        case ".csv":
            return _lines(path, data)
        case ".parquet":
            return pq.read_table(pa.BufferReader(data), page_checksum_verification=True), ""
        case ".mcap":
            return pa.Table.from_pylist(_messages(data)), ""
        case _:
            raise Mistake(f"{path}: a log is a file .csv, .parquet or .mcap")


def _lines(path: Path, data: bytes) -> tuple[pa.Table, str]:
    """Return the rows of a CSV file. A last line without an end may have lost some of its digits,
    so it is left out; a file system may fill up what was not written with zeros.
    """
    data = data.rstrip(b"\0")
    whole = 1 + data.rfind(b"\n")
    cut = ""
    if 0 < whole < len(data):
        number = 1 + data.count(b"\n")
        cut = f"line {number}, the last, was left out: it has no line end, so it may be cut"
        data = data[:whole]
    head = io.BytesIO(data).readline()
    if b"\0" in data:
        raise ValueError("these are no lines of text")
    if b"," not in head and re.search(rb"[;\t]", head):
        separator = "a semicolon" if b";" in head else "a tab"
        raise Mistake(
            f"{path}: line 1 has {separator} between its columns; a log has a comma there, and a "
            "point in its numbers"
        )
    wrong: list[pyarrow.csv.InvalidRow] = []

    def refuse(row: pyarrow.csv.InvalidRow) -> str:
        wrong.append(row)
        return "error"

    try:
        table = pyarrow.csv.read_csv(
            io.BytesIO(data),
            # Only one thread counts the rows.
            read_options=pyarrow.csv.ReadOptions(use_threads=False),
            parse_options=pyarrow.csv.ParseOptions(invalid_row_handler=refuse),
        )
    except pa.ArrowInvalid:
        if not wrong:
            raise
        row = wrong[0]
        cells = f"{row.actual_columns} cells; line 1 names {row.expected_columns} columns"
        raise Mistake(f"{path}: line {row.number} has {cells}") from None
    return table, cut


def _no_number(column: pa.ChunkedArray) -> str:
    """Which row of a column is the first that is no number, in words."""
    for number, value in enumerate(column.to_pylist(), start=1):
        try:
            float(value)
        except (TypeError, ValueError):
            if value is not None:
                return f"row {number} has {str(value)!r}"
    return f"it has {column.type}"


def _numbers(table: pa.Table) -> dict[str, Array]:
    """Return the columns of numbers; an empty cell is nan."""
    numbers = (pa.types.is_integer, pa.types.is_floating, pa.types.is_boolean)
    return {
        name: np.array(column.to_pylist(), np.float64)
        for name, column in zip(table.column_names, table.columns, strict=True)
        if any(is_kind(column.type) for is_kind in numbers)
    }


def _messages(data: bytes) -> list[dict[str, Any]]:
    """Return the JSON messages with a time_s of a log in MCAP."""
    try:
        from mcap.exceptions import McapError
        from mcap.reader import make_reader
    except ImportError:
        raise Mistake(NEEDS) from None
    try:
        found = list(make_reader(io.BytesIO(data)).iter_messages())
    except McapError as error:
        raise ValueError(error) from error
    rows = [json.loads(m.data) for _, channel, m in found if channel.message_encoding == "json"]
    return [row for row in rows if isinstance(row, dict) and "time_s" in row]


def _lost(time: Array) -> Array:
    """Return how many rows are missing before each row (n,).

    None is where rows come irregularly, as those of several sources do.
    """
    intervals = np.diff(time) / np.median(np.diff(time))
    whole = np.rint(intervals)
    if np.mean(np.abs(intervals - whole) < OFF_WHOLE) < REGULAR:
        return np.zeros(len(time))
    return np.append(0.0, np.maximum(whole - 1, 0.0))


def _pictures(columns: dict[str, Array], lost: Array) -> tuple[Array, Array]:
    """Return the stamps (n,) of the commands, nan where there is none; and from each row's stamp
    to its picture's arrival (n,) [s].

    A command after missing rows came with one of them or with its own row: the middle of these
    stamps is right on average.
    """
    time = columns["time_s"]
    if set(PICTURES) <= columns.keys():
        at = np.searchsorted(columns["frame"], columns["picture"])
        made = np.where(columns["decided"] > 0, time[at] + columns["age_s"], np.nan)
        return made, np.where(columns["decided"] > 0, columns["age_s"], np.nan)
    waited = columns.get("arrived_s", np.full(len(time), np.nan)) - time
    since = np.where(lost < BRIDGED, lost * np.diff(time, prepend=time[0]) / (lost + 1), 0.0)
    return columns.get("asked_s", time - since / 2), waited


def _late(time: Array, asked: Array) -> float:
    """Return how much later than its row a command is, at the median of those that are new [s]."""
    new = np.isfinite(asked) & (np.diff(asked, prepend=np.nan) != 0)
    return float(np.median((asked - time)[new])) if new.any() else 0.0


def _arrivals(waited: Array, *, is_with_commands: bool) -> tuple[str, Array]:
    """Return what is wrong with the waits of pictures, and those (k,) [s] that can be used.

    A clock that is off leaves the differences of the waits, which show jitter. It leaves the sum of
    wait and delay where commands have its stamps too: both are off by as much, in opposite ways.
    One that is faster or is set in between, and waits that are not uniform, leave nothing.

    Args:
        waited: From each row's stamp to its picture's arrival (n,) [s]; nan where there is none.
        is_with_commands: True where commands are before their rows, as arrivals may be.
    """
    rows = np.flatnonzero(np.isfinite(waited))
    found = waited[rows].clip(-FARTHEST, FARTHEST)
    ordered = np.sort(found)
    few = f"{len(found)} rows have arrived_s, fewer than {FEWEST}; it is not used"
    if len(found) < FEWEST:
        return few if len(found) else "", np.empty(0)
    place = (rows - rows.mean()) / np.std(rows)
    slope = float(np.mean(place * found))
    error = float(np.std(found - slope * place)) / np.sqrt(len(found))
    trend = slope * float(np.ptp(place))
    if abs(slope) > DRIFTS * error and abs(trend) > LEAST_DRIFT:
        return (
            f"arrived_s drifts by {trend:.3g} s against time_s, so it is in another unit or of "
            "another clock; it is not used"
        ), np.empty(0)
    if uneven := _uneven(found):
        return f"{uneven}, and a simulated wait is uniform; arrived_s is not used", np.empty(0)
    if ordered[0] >= 0 and ordered[-1] <= LATEST:
        late = f"pictures arrive {ordered[0]:.3g} s after their stamps or later: is this one clock?"
        return late if ordered[0] > SLOW else "", found
    other = f"pictures arrive {ordered[0]:.6g} to {ordered[-1]:.6g} s after their stamps, so "
    if is_with_commands and ordered[0] > -LATEST:
        return (
            f"{other}arrived_s and asked_s are of another clock than time_s; latency_ms is right "
            "if both are of the same"
        ), found
    return (
        f"{other}arrived_s is of another clock, and the shortest wait, not known, is not in "
        "latency_ms"
    ), found - ordered[0]


def _uneven(waits: Array) -> str:
    """Return why waits (n,) [s] are not of one uniform distribution; empty where they may be."""
    gaps = np.diff(np.sort(waits))
    reach = gaps.sum()
    if reach < COARSE:
        return ""
    at = int(np.argmax(gaps))
    if 2 * gaps[at] > reach:
        apart = min(at + 1, len(gaps) - at)
        return f"{apart} of {len(waits)} pictures arrive {gaps[at]:.3g} s apart from all others"
    pieces = np.array_split(waits, min(PIECES, len(waits) // FEWEST))
    quarters = np.array([np.quantile(piece, (0.25, 0.5, 0.75)) for piece in pieces])
    middle = float(np.median(quarters[:, 2] - quarters[:, 0]))
    swings = np.ptp(quarters[:, 1]) > middle
    if swings or np.corrcoef(waits[1:], waits[:-1])[0, 1] > SWINGS:
        return f"the wait for pictures swings by {reach:.3g} s in the course of the log"
    if reach > TAIL * middle:
        return (
            f"half of the pictures arrive within {middle:.3g} s, but all of them in {reach:.3g} s"
        )
    return ""


def _check_positions(columns: dict[str, Array], name: str, unit: str, path: Path) -> None:
    """Refuse numbers and changes of positions that no robot has."""
    time = columns["time_s"]
    fastest = 0.0
    for key in _parts(name, unit):
        series = _series(time, columns.get(key, np.full(len(time), np.nan)))
        largest = float(np.abs(series.values).max(initial=0.0))
        if largest > FARTHEST:
            raise Mistake(f"{path}: {key} has {largest:.3g}, which no robot has")
        fastest = largest if key.startswith("command_") else fastest
        changes = np.abs(np.diff(series.values))
        # One that is not asked to move is not used.
        if key.endswith("_s") or len(changes) < FEWEST or not changes.any() or not fastest:
            continue
        limits = JUMP[0] * fastest * np.diff(series.times)
        limits += JUMP[1] * np.quantile(changes[changes > 0], 0.9)
        if np.any(changes > limits):
            at = int(np.argmax(changes - limits))
            raise Mistake(
                f"{path}: {key} jumps by {changes[at]:.3g} {unit} at time_s = "
                f"{series.times[at + 1]:.6g}, which no command explains: leave out what is wrong"
            )


def _channel(columns: dict[str, Array], asked: Array, name: str, unit: str) -> Channel:
    time = columns["time_s"]
    empty = np.full(len(time), np.nan)
    joint = columns.get(f"joint_{name}_{unit}", empty)
    encoder = columns.get(f"encoder_{name}_{unit}", empty)
    measured = columns.get(f"measured_{name}_{unit}_s", empty)
    is_behind = bool(np.isfinite(joint).any())
    moved = next((each for each in (joint, encoder) if np.isfinite(each).any()), None)
    if moved is None:
        moved = np.cumsum(np.diff(time, prepend=time[0]) * measured)
    return Channel(
        name,
        unit,
        _series(asked, columns[f"command_{name}_{unit}_s"]),
        _averaged(_series(time, moved)),
        _series(time, encoder),
        is_behind,
    )


def _series(times: Array, values: Array) -> Series:
    """The values that there are, in order."""
    known = np.flatnonzero(np.isfinite(times) & np.isfinite(values))
    order = known[np.argsort(times[known], kind="stable")]
    return Series(times[order], values[order])


def _averaged(series: Series) -> Series:
    """The means of the numbers in each piece of time, where they come faster."""
    times = series.times
    if len(times) < FEWEST or np.median(np.diff(times)) > FINEST / 2:
        return series
    first = np.flatnonzero(np.diff((times - times[0]) // FINEST, prepend=-1))
    counts = np.diff(first, append=len(times))
    means = [np.add.reduceat(each, first) / counts for each in (times, series.values)]
    return Series(*means)
