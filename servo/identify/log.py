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
STAMPS = ("time_s", "asked_s", "arrived_s")
PICTURES = ("age_s", "picture", "frame", "decided")
"""Columns of a run's own log that say when pictures were made, and which were used."""
SHORTEST = 2.0
"""A shorter log has too few movements [s]."""
LONGEST = 600.0
"""A longer one takes long, and adds little [s]."""
OFF_WHOLE = 0.2
"""An interval of rows is regular if it is less than this off a multiple of the usual interval."""
REGULAR = 0.9
"""Rows are looked for that are missing if at least this part of the intervals is regular."""
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
        return len(self.values) > 1 and bool(np.ptp(self.values) > 0)


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

    @property
    def uncertain(self) -> float:
        """So far the stamp of a command in a gap is from the true one, on average [s]."""
        return self.missing * self.interval


def read(path: Path) -> Log:
    """Read a log: CSV, Parquet, or MCAP with JSON messages, such as /step of our own.

    Raises:
        Mistake: It cannot be read, or nothing in it was asked to move and moved.
    """
    try:
        table, cut = _table(path)
        columns = _numbers(table)
    except (pa.ArrowException, ValueError) as error:
        if isinstance(error, Mistake) or str(error).startswith(str(path)):
            raise Mistake(str(error)) from None
        kind = path.suffix[1:].upper()
        raise Mistake(f"{path}: cannot read this log: it is damaged, or no {kind} file") from error
    if "time_s" not in table.column_names:
        has = listed(table.column_names, NAMED) or "none"
        raise Mistake(
            f"{path}: this log has no column time_s; it needs time_s, {COLUMNS}; it has {has}"
        )
    named = [found for name in table.column_names if (found := COMMAND.fullmatch(name))]
    used = set(STAMPS)
    for name, unit in (found.groups() for found in named):
        of = f"{name}_{unit}"
        used |= {f"command_{of}_s", f"joint_{of}", f"encoder_{of}", f"measured_{of}_s"}
    for name, column in zip(table.column_names, table.columns, strict=True):
        if name in used - columns.keys() and not pa.types.is_null(column.type):
            raise Mistake(f"{path}: {name} should have numbers; {_no_number(column)}")
    used |= set(PICTURES)
    time = columns.get("time_s", np.empty(0))
    if not (len(time) and np.isfinite(time).all() and np.all(np.diff(time) > 0)):
        raise Mistake(f"{path}: time_s should increase from row to row")
    if not SHORTEST <= np.ptp(time) <= LONGEST:
        length = f"{np.ptp(time):.3g} s long; {SHORTEST:g} to {LONGEST:g} s are needed"
        raise Mistake(f"{path}: this log is {length}")
    lost = _lost(time)
    asked, transport = _pictures(columns, lost)
    named = [found for found in named if found[0] in columns]
    channels = [_channel(columns, asked, *found.groups()) for found in named]
    moving = [c for c in channels if c.command.varies and c.moved.varies]
    if not moving:
        raise Mistake(
            f"{path}: nothing in this log was asked to move and moved; it needs columns {COLUMNS}"
        )
    unused = [name for name in table.column_names if name not in used & columns.keys()]
    return Log(
        moving,
        transport,
        unused,
        [(c.name, c.unit) for c in channels],
        float(np.median(np.diff(time))),
        float(lost.sum() / (lost.sum() + len(time))),
        cut,
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
    """Return the stamps (n,) of the commands, nan where there is none; and from each picture's
    stamp to its arrival (k,) [s].

    A command after missing rows came with one of them or with its own row: the middle of these
    stamps is right on average.
    """
    time = columns["time_s"]
    if set(PICTURES) <= columns.keys():
        at = np.searchsorted(columns["frame"], columns["picture"])
        made = np.where(columns["decided"] > 0, time[at] + columns["age_s"], np.nan)
        return made, columns["age_s"][columns["decided"] > 0]
    waited = columns.get("arrived_s", np.full(len(time), np.nan)) - time
    since = np.where(lost < BRIDGED, lost * np.diff(time, prepend=time[0]) / (lost + 1), 0.0)
    return columns.get("asked_s", time - since / 2), waited[np.isfinite(waited)]


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
        _series(time, moved),
        _series(time, encoder),
        is_behind,
    )


def _series(times: Array, values: Array) -> Series:
    """The values that there are, in order."""
    known = np.flatnonzero(np.isfinite(times) & np.isfinite(values))
    order = known[np.argsort(times[known], kind="stable")]
    return Series(times[order], values[order])
