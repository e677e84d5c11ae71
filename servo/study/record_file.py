"""Converts records (the results of runs) to texts and bytes for the database, and to tables for
users.
"""

import io
import json
from array import array
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from servo.scenario.toml import Table
from servo.study.bounds import MissedBound
from servo.study.run import SCENARIO, Record, RunRow, version_columns
from tracking.files.json_text import as_json

RUN = "run"
MISSED = pa.list_(pa.struct([(name, pa.string()) for name in ("name", "found", "bound")]))
"""Type of the column of missed bounds; numbers are texts, as the bound on the outcome is."""


def stored(record: Record) -> tuple[str, bytes, bytes | None]:
    """Return a run's record for the database: its values as JSON, its series over time as an NPZ
    file, and its contact sheet (an image with pictures of the run) as JPEG; None in place of the
    last if the record has none.
    """
    text = json.dumps(as_json(replace(record, series={}, sheet=None)))
    series = io.BytesIO()
    arrays: dict[str, Any] = record.series
    np.savez(series, **arrays)
    return text, series.getvalue(), record.sheet


def record_of(text: str, series: bytes | None, sheet: bytes | None) -> Record:
    """Return the record of a run from what `stored` returned for it: JSON, NPZ file and JPEG.

    Measures that are not finite, and the wall-clock time, become nan. Without the NPZ file (None)
    the record has no series over time, and without the JPEG no picture.
    """
    found = json.loads(text)
    measures = found["measures"].items()
    found["measures"] = {k: np.nan if v is None else float(v) for k, v in measures}
    found["missed"] = tuple(MissedBound(**missed) for missed in found["missed"])
    found["seconds"] = np.nan
    found["series"] = {} if series is None else dict(np.load(io.BytesIO(series)))
    return Record(**found | {"sheet": sheet})


def series_table(records: Sequence[Record]) -> pa.Table:
    """Return an Arrow table with a row for each run: the run's number, each of its series over time
    as a list, and its contact sheet (an image with pictures of the run) as JPEG; null where a
    record has none.
    """
    names = dict.fromkeys(name for record in records for name in record.series)
    lists = {name: pa.array([record.series.get(name) for record in records]) for name in names}
    sheets = pa.array([record.sheet for record in records], pa.binary())
    return pa.table({RUN: [record.number for record in records], **lists, "sheet": sheets})


def table_of(batches: Iterable[Sequence[Record]]) -> pa.Table:
    """Return the Arrow table of a study's results, with a row for each run: number, scenario or
    sequence, seed, settings, whether the run repeats, outcome, success, missed bounds, measures and
    versions. A setting becomes a column of texts unless its values are all flags or all numbers.

    Args:
        batches: Records in the order of the study, at least one, in lists: the conversion of all
            records at once would take much more memory than the table.
    """
    settings: list[Table] = []
    tables: list[pa.Table] = []
    for records in batches:
        settings += [record.settings for record in records]
        rows = [record.row for record in records]
        tables.append(pa.Table.from_pylist(rows, pa.schema(_types(records[0]).items())))
    table = pa.concat_tables(tables)
    for key in [key for key in settings[0] if key != SCENARIO]:
        values = [each[key] for each in settings]
        kind = _type(values)
        if kind == pa.string():
            values = [None if value is None else str(value) for value in values]
        column = pa.array(values, kind)
        table = table.add_column(table.column_names.index("repeats"), key, column)
    return table


def _types(record: Record) -> dict[str, pa.DataType]:
    """Return the Arrow type of each column of the results of runs, by name; the columns of settings
    are not included.
    """
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


@dataclass(frozen=True, slots=True, eq=False)
class TableRow(Mapping[str, Any]):
    """A row of an Arrow table as a read-only mapping from column to value, with None in place of
    nan. `place` is the row's index; all rows share the converted columns, to save memory.
    """

    table: pa.Table
    column: Callable[[str], Sequence[Any]]
    """Function that returns a column by its name."""
    place: int
    """Index of the row."""

    def __getitem__(self, name: str) -> Any:
        value = self.column(name)[self.place]
        return None if value != value else value  # nan

    def __iter__(self) -> Iterator[str]:
        return iter(self.table.column_names)

    def __len__(self) -> int:
        return self.table.num_columns


def _column(table: pa.Table, name: str) -> Sequence[Any]:
    """Return the values of a column of a table."""
    column = table[name]
    return (
        array("d", column.to_numpy()) if pa.types.is_floating(column.type) else column.to_pylist()
    )


def rows_of(table: pa.Table) -> list[RunRow]:
    """Return the rows of an Arrow table of results as read-only mappings from column to value, with
    None in place of nan.
    """
    column = cache(partial(_column, table))  # each column is converted when it is first used
    return [TableRow(table, column, place) for place in range(table.num_rows)]


def parquet(table: pa.Table, **options: Any) -> bytes:
    """Return an Arrow table as the bytes of a Parquet file, whose pages have checksums.

    Args:
        table: The table.
        **options: Further arguments of PyArrow's `write_table`, such as `compression`.
    """
    sink = pa.BufferOutputStream()
    pq.write_table(table, sink, write_page_checksum=True, **options)
    return sink.getvalue().to_pybytes()


def _type(values: Iterable[object]) -> pa.DataType:
    """Return the Arrow type of a column: bool, int, float (also if some values are int), or text
    for other and for mixed types.
    """
    kinds = {type(v) for v in values}
    if kinds == {bool}:
        return pa.bool_()
    if kinds == {int}:
        return pa.int64()
    return pa.float64() if kinds <= {int, float} else pa.string()
