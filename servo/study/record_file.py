"""The file of a record: a Parquet table of one row, with a column for each setting and measure.

Its long columns are lists.
"""

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from servo.study.bounds import MissedBound
from servo.study.run import SCENARIO, Record, version_columns

SHEET = "sheet"
MISSED = pa.list_(pa.struct([(name, pa.string()) for name in ("name", "found", "bound")]))
"""Numbers are texts here, because a bound on the outcome is a word."""
ABOUT = b"servobench"
"""Key of the file's metadata: what decides the record, and which columns are settings."""
DIGEST = b"sha256"
"""Key of the digest of that and of the columns: Parquet has checksums of the values alone."""


def encoded(record: Record, job: Mapping[str, Any]) -> bytes:
    """The file of a record's row; `job` describes what decides it."""
    table = table_of([record])
    for name, values in record.series.items():
        table = table.append_column(
            name, pa.array([values], pa.list_(pa.from_numpy_dtype(values.dtype)))
        )
    table = table.append_column(SHEET, pa.array([record.sheet], pa.binary()))
    about = {
        "job": job,
        "subject_is": record.subject_is,
        "settings": list(record.settings),
        "measures": list(record.measures),
        "versions": record.versions,
        "command": record.command,
    }
    text = json.dumps(about).encode()
    metadata = {ABOUT: text, DIGEST: _digest(text, table.column_names)}
    return parquet(table.replace_schema_metadata(metadata))


def decoded(raw: bytes, job: Mapping[str, Any] | None = None) -> Record | None:
    """The record in a file; None if the file is damaged, or of another job than a given one."""
    try:
        table = pq.read_table(pa.BufferReader(raw), page_checksum_verification=True)
        metadata = table.schema.metadata or {}
        text = metadata.get(ABOUT, b"")
        if metadata.get(DIGEST) != _digest(text, table.column_names):
            return None
        about = json.loads(text)
        if table.num_rows != 1 or (job is not None and about["job"] != job):
            return None
        kind = about["subject_is"]
        keys = {"run", kind, "seed", "repeats", "outcome", "success", "missed", SHEET}
        keys |= {*about["settings"], *about["measures"]}
        keys |= {*version_columns(about["versions"])}
        long = [name for name in table.column_names if name not in keys]
        row = table.drop_columns(long).to_pylist()[0]
        return Record(
            number=row["run"],
            subject=row[kind],
            subject_is=kind,
            seed=row["seed"],
            settings={key: row[key] for key in about["settings"]},
            command=about["command"],
            outcome=row["outcome"],
            success=row["success"],
            measures={k: np.nan if row[k] is None else float(row[k]) for k in about["measures"]},
            missed=tuple(MissedBound(**m) for m in row["missed"]),
            repeats=row["repeats"],
            versions=about["versions"],
            series={n: table[n][0].values.to_numpy(zero_copy_only=False) for n in long},
            sheet=row[SHEET],
        )
    # A file of zeros after a crash, flipped bits, or columns that are not those of a record.
    except (pa.ArrowException, OSError, ValueError, OverflowError, MemoryError):
        return None
    except (AttributeError, KeyError, TypeError):
        return None


def table_of(records: Sequence[Record]) -> pa.Table:
    """The rows of some records, at least one, as a table; values of mixed types are texts."""
    rows = [record.row for record in records]
    first = records[0]
    types = {
        "run": pa.int64(),
        first.subject_is: pa.string(),
        "seed": pa.int64(),
        **{key: _type(row[key] for row in rows) for key in first.settings if key != SCENARIO},
        "repeats": pa.bool_(),
        "outcome": pa.string(),
        "success": pa.bool_(),
        "missed": MISSED,
        **dict.fromkeys(first.measures, pa.float64()),
        **dict.fromkeys(version_columns(first.versions), pa.string()),
    }
    schema = pa.schema(list(types.items()))
    return pa.Table.from_pylist(
        [{name: _cell(row[name], kind) for name, kind in types.items()} for row in rows], schema
    )


def parquet(table: pa.Table) -> bytes:
    """A table as a Parquet file with checksums."""
    sink = pa.BufferOutputStream()
    pq.write_table(table, sink, write_page_checksum=True)
    return sink.getvalue().to_pybytes()


def _digest(about: bytes, columns: Sequence[str]) -> bytes:
    return hashlib.sha256(about + "\n".join(columns).encode()).hexdigest().encode()


def _cell(value: Any, kind: pa.DataType) -> Any:
    return value if kind != pa.string() or value is None else str(value)


def _type(values: Iterable[Any]) -> pa.DataType:
    kinds = {type(v) for v in values}
    if kinds == {bool}:
        return pa.bool_()
    if kinds == {int}:
        return pa.int64()
    return pa.float64() if kinds <= {int, float} else pa.string()
