"""Records of runs as Parquet: files of one or many for the store, and tables for users.

A row of a file has the key of its job, a digest of what decides it, and the record as JSON; series
are lists in columns of their own.
"""

import hashlib
import json
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from servo.study.bounds import MissedBound
from servo.study.run import SCENARIO, Job, Record, Row, version_columns
from tracking.files.json_text import as_json

KEY = "key"
JOB = "job"
RECORD = "record"
SHEET = "sheet"
OWN = (KEY, JOB, RECORD, SHEET)
"""Columns that are no series."""
MISSED = pa.list_(pa.struct([(name, pa.string()) for name in ("name", "found", "bound")]))
"""Numbers are texts here, because a bound on the outcome is a word."""
DIGEST = b"sha256"
"""Key of the digest of the names of the columns: Parquet has checksums of the values alone."""


@dataclass(frozen=True, slots=True)
class Kept:
    """A row of a file."""

    job: str
    """Digest of the job."""
    record: Record


def file_table(job: Job, record: Record) -> pa.Table:
    """The row of a record."""
    text = json.dumps(as_json(replace(record, series={}, sheet=None)))
    long = {
        name: pa.array([values], pa.list_(pa.from_numpy_dtype(values.dtype)))
        for name, values in record.series.items()
    }
    sheet = pa.array([record.sheet], pa.binary())
    return pa.table({KEY: [job.key], JOB: [job.digest], RECORD: [text], SHEET: sheet, **long})


def merged(tables: Iterable[pa.Table]) -> pa.Table:
    """One table by key; the last row of a key counts."""
    whole = pa.concat_tables(tables, promote_options="permissive")
    last = {key: place for place, key in enumerate(whole[KEY].to_pylist())}
    return whole.take([last[key] for key in sorted(last)])


def encoded(table: pa.Table) -> bytes:
    """The file of rows."""
    return parquet(table.replace_schema_metadata({DIGEST: _digest(table.column_names)}))


def table_in(raw: bytes) -> pa.Table | None:
    """The rows in a file; None if it is damaged."""
    try:
        table = pq.read_table(pa.BufferReader(raw), page_checksum_verification=True)
    # A file of zeros after a crash, or flipped bits.
    except (pa.ArrowException, OSError, ValueError, OverflowError, MemoryError):
        return None
    found = (table.schema.metadata or {}).get(DIGEST)
    return table if found == _digest(table.column_names) else None


def decoded(
    raw: bytes, keys: Collection[str] | None = None, *, long: bool = False
) -> dict[str, Kept] | None:
    """The records in a file by the key of their job; None if it is damaged.

    Args:
        raw: The file.
        keys: Of the jobs whose records are wanted; None: all.
        long: Whether the records keep their series and contact sheets.
    """
    table = table_in(raw)
    if table is None:
        return None
    try:
        own = zip(*(table[name].to_pylist() for name in (KEY, JOB, RECORD)), strict=True)
        return {
            key: Kept(job, _record(text, table.slice(place, 1) if long else None))
            for place, (key, job, text) in enumerate(own)
            if keys is None or key in keys
        }
    except (AttributeError, KeyError, TypeError, ValueError):  # columns that are not ours
        return None


def _record(text: str, row: pa.Table | None) -> Record:
    """The record in a text, with the series and the sheet of its row."""
    found = json.loads(text)
    found["measures"] = {k: np.nan if v is None else float(v) for k, v in found["measures"].items()}
    found["missed"] = tuple(MissedBound(**missed) for missed in found["missed"])
    found["seconds"] = np.nan
    record = Record(**found)
    if row is None:
        return record
    cells = {name: row[name][0] for name in row.column_names if name not in OWN}
    series = {
        name: cell.values.to_numpy(zero_copy_only=False).copy()  # else it keeps the whole file
        for name, cell in cells.items()
        if cell.is_valid
    }
    return replace(record, series=series, sheet=row[SHEET][0].as_py())


def table_of(batches: Iterable[Sequence[Record]]) -> pa.Table:
    """The rows of some records, at least one, as a table; values of mixed types are texts."""
    settings: list[dict[str, Any]] = []
    tables: list[pa.Table] = []
    for records in filter(None, batches):
        settings += [record.settings for record in records]
        tables.append(_short_columns(records))
    table = pa.concat_tables(tables)
    for key in [key for key in settings[0] if key != SCENARIO]:
        values = [each[key] for each in settings]
        kind = _type(values)
        column = pa.array([_cell(value, kind) for value in values], kind)
        table = table.add_column(table.column_names.index("repeats"), key, column)
    return table


def _short_columns(records: Sequence[Record]) -> pa.Table:
    """The columns of records without their settings."""
    first = records[0]
    types = {
        "run": pa.int64(),
        first.subject_is: pa.string(),
        "seed": pa.int64(),
        "repeats": pa.bool_(),
        "outcome": pa.string(),
        "success": pa.bool_(),
        "missed": MISSED,
        **dict.fromkeys(first.measures, pa.float64()),
        **dict.fromkeys(version_columns(first.versions), pa.string()),
    }
    return pa.Table.from_pylist([record.row for record in records], pa.schema(list(types.items())))


class _Columns(dict[str, list[Any]]):
    """The columns of a table, read when they are first used."""

    def __init__(self, table: pa.Table) -> None:
        super().__init__()
        self.table = table

    def __missing__(self, name: str) -> list[Any]:
        self[name] = self.table[name].to_pylist()
        return self[name]


@dataclass(frozen=True, slots=True, eq=False)
class TableRow(Mapping[str, Any]):
    """A row of a table; a hundred thousand of them need no more memory than the columns."""

    columns: _Columns
    place: int

    def __getitem__(self, name: str) -> Any:
        return self.columns[name][self.place]

    def __iter__(self) -> Iterator[str]:
        return iter(self.columns.table.column_names)

    def __len__(self) -> int:
        return self.columns.table.num_columns


def rows_of(table: pa.Table) -> list[Row]:
    """The rows of a table."""
    columns = _Columns(table)
    return [TableRow(columns, place) for place in range(table.num_rows)]


def parquet(table: pa.Table) -> bytes:
    """A table as a Parquet file with checksums."""
    sink = pa.BufferOutputStream()
    pq.write_table(table, sink, write_page_checksum=True)
    return sink.getvalue().to_pybytes()


def _digest(columns: Sequence[str]) -> bytes:
    return hashlib.sha256("\n".join(columns).encode()).hexdigest().encode()


def _cell(value: Any, kind: pa.DataType) -> Any:
    return value if kind != pa.string() or value is None else str(value)


def _type(values: Iterable[Any]) -> pa.DataType:
    kinds = {type(v) for v in values}
    if kinds == {bool}:
        return pa.bool_()
    if kinds == {int}:
        return pa.int64()
    return pa.float64() if kinds <= {int, float} else pa.string()
