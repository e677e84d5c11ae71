"""Records of runs as Parquet: files of one or many for the store, and tables for users.

A row of a file has the key of its job, a digest of what decides it, the record as JSON, and in
columns of their own again all that is a number; series are lists.
"""

import hashlib
import json
from array import array
from collections.abc import Iterable, Iterator, Mapping, Sequence
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
RUN = "run"
NOTHING = pa.table({KEY: pa.array([], pa.string()), JOB: [], RUN: [], RECORD: []})
"""What a damaged file gives."""
MISSED = pa.list_(pa.struct([(name, pa.string()) for name in ("name", "found", "bound")]))
"""Numbers are texts here, because a bound on the outcome is a word."""
DIGEST = b"sha256"
"""Key of the digest of the names of the columns: Parquet has checksums of the values alone."""


def file_table(job: Job, record: Record) -> pa.Table:
    """The row of a record."""
    text = json.dumps(as_json(replace(record, series={}, sheet=None)))
    own = {KEY: pa.array([job.key]), JOB: pa.array([job.digest]), RECORD: pa.array([text])}
    long = {
        name: pa.array([values], pa.list_(pa.from_numpy_dtype(values.dtype)))
        for name, values in record.series.items()
    }
    long[SHEET] = pa.array([record.sheet], pa.binary())
    short = {name: pa.array([record.row[name]], kind) for name, kind in _types(record).items()}
    return pa.table({**own, **short, **long})


def merged(tables: Iterable[pa.Table]) -> pa.Table:
    """One table by key; the last row of a key counts."""
    whole = pa.concat_tables(tables, promote_options="permissive")
    last = {key: place for place, key in enumerate(whole[KEY].to_pylist())}
    return whole.take([last[key] for key in sorted(last)])


def encoded(table: pa.Table) -> bytes:
    """The file of rows."""
    return parquet(table.replace_schema_metadata({DIGEST: _digest(table.column_names)}))


def table_in(raw: bytes) -> pa.Table:
    """The rows in a file; none if it is damaged."""
    try:
        table = pq.read_table(pa.BufferReader(raw), page_checksum_verification=True)
    # A file of zeros after a crash, or flipped bits.
    except (pa.ArrowException, OSError, ValueError, OverflowError, MemoryError):
        return NOTHING
    found = (table.schema.metadata or {}).get(DIGEST)
    return table if found == _digest(table.column_names) and _is_ours(table) else NOTHING


def _is_ours(table: pa.Table) -> bool:
    """Return whether rows are records, judged by the types of columns and by the first one."""
    try:
        record = next(records_of(table.slice(0, 1), long=True))
        own = {KEY: pa.string(), JOB: pa.string(), SHEET: pa.binary(), **_types(record)}
        return all(table.schema.field(name).type.equals(kind) for name, kind in own.items())
    except (KeyError, TypeError, ValueError, AttributeError, StopIteration):  # also of Arrow
        return False


def records_of(table: pa.Table, *, long: bool = False) -> Iterator[Record]:
    """The records of a file's rows; only if `long`, with their series and contact sheets."""
    for place, text in enumerate(table[RECORD].to_pylist()):
        found = json.loads(text)
        measures = found["measures"].items()
        found["measures"] = {k: np.nan if v is None else float(v) for k, v in measures}
        found["missed"] = tuple(MissedBound(**missed) for missed in found["missed"])
        found["seconds"] = np.nan
        record = Record(**found)
        if long:
            row = table.slice(place, 1).drop_columns([KEY, JOB, RECORD, *_types(record)])
            sheet = row[SHEET][0].as_py()
            cells = {name: row[name][0] for name in row.column_names if name != SHEET}
            series = {
                name: cell.values.to_numpy(zero_copy_only=False).copy()  # not the whole file
                for name, cell in cells.items()
                if cell.is_valid
            }
            record = replace(record, series=series, sheet=sheet)
        yield record


def table_of(files: Iterable[pa.Table]) -> pa.Table:
    """The rows of files, at least one, as users have them; settings of mixed types are texts."""
    settings: list[dict[str, Any]] = []
    tables: list[pa.Table] = []
    for rows in files:
        settings += [json.loads(text)["settings"] for text in rows[RECORD].to_pylist()]
        tables.append(rows.select([*_types(next(records_of(rows)))]))
    table = pa.concat_tables(tables)
    for key in [key for key in settings[0] if key != SCENARIO]:
        values = [each[key] for each in settings]
        kind = _type(values)
        column = pa.array([_cell(value, kind) for value in values], kind)
        table = table.add_column(table.column_names.index("repeats"), key, column)
    return table.take(np.argsort(table[RUN], kind="stable"))


def _types(record: Record) -> dict[str, pa.DataType]:
    """The short columns of a record without its settings."""
    return {
        RUN: pa.int64(),
        record.subject_is: pa.string(),
        "seed": pa.int64(),
        "repeats": pa.bool_(),
        "outcome": pa.string(),
        "success": pa.bool_(),
        "missed": MISSED,
        **dict.fromkeys(record.measures, pa.float64()),
        **dict.fromkeys(version_columns(record.versions), pa.string()),
    }


class _Columns(dict[str, Sequence[Any]]):
    """The columns of a table, read when they are first used."""

    def __init__(self, table: pa.Table) -> None:
        super().__init__()
        self.table = table

    def __missing__(self, name: str) -> Sequence[Any]:
        column = self.table[name]
        floats = pa.types.is_floating(column.type)
        self[name] = array("d", column.to_numpy()) if floats else column.to_pylist()
        return self[name]


@dataclass(frozen=True, slots=True, eq=False)
class TableRow(Mapping[str, Any]):
    """A row of a table; a hundred thousand of them need no more memory than the columns."""

    columns: _Columns
    place: int

    def __getitem__(self, name: str) -> Any:
        value = self.columns[name][self.place]
        return None if value != value else value  # nan

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
