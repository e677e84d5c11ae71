"""The file of one finished run: a Parquet table of one row, checked against the study."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from servo.loop.run_measures import MEANINGS
from servo.study.perform import Row, version_columns
from servo.study.plan import Run, Study
from sim.files import reading

FLOATS, FLAGS = pa.list_(pa.float32()), pa.list_(pa.bool_())
MISSED = pa.list_(pa.struct([(name, pa.string()) for name in ("name", "found", "bound")]))
"""Bounds that a run did not keep; numbers are texts, because a bound on the outcome is a word."""
MOST_BYTES = 100_000_000
SERIES = {"time_s": FLOATS, "servo_error_px": FLOATS, "tracking_error_px": FLOATS,
          "on_target": FLAGS, "sheet": pa.binary()}  # fmt: skip
"""Columns of a run's own file that are not in the table of all runs."""


class RunFiles:
    """Writes and reads the rows of one study."""

    def __init__(self, study: Study) -> None:
        self._own = columns(study)
        self._schema = pa.schema([*self._own, *SERIES.items()])
        self._types = dict(self._own)

    def encoded(self, row: Row) -> bytes:
        """The file of a row."""
        cells = {f.name: _cell(row.get(f.name), f.type) for f in self._schema}
        return parquet(pa.Table.from_pylist([cells], self._schema))

    def read(self, path: Path) -> pa.Table | None:
        """The row without its long columns; None if the file is not as it was written."""
        try:
            # Read into memory first: the file could change while it is parsed.
            raw = pa.BufferReader(reading.content(path, "row", MOST_BYTES))
            whole = pq.read_table(raw, page_checksum_verification=True)
        except (pa.ArrowException, OSError, ValueError, OverflowError, MemoryError):
            return None  # a file of zeros after a crash, or flipped bits
        if whole.num_rows != 1 or not whole.schema.equals(self._schema):
            return None
        return whole.select([name for name, _ in self._own])

    def fits(self, table: pa.Table, run: Run) -> bool:
        """Whether a row is the result of a run with the versions that are installed now."""
        row = table.to_pylist()[0]
        wanted = {"run": run.number, "scenario": run.base.name, "seed": run.seed}
        wanted |= {k: _cell(v, self._types[k]) for k, v in run.settings.items()}
        return all(row[k] == v for k, v in (wanted | version_columns()).items())


def parquet(table: pa.Table) -> bytes:
    """A table as a Parquet file with checksums."""
    sink = pa.BufferOutputStream()
    pq.write_table(table, sink, write_page_checksum=True)
    return sink.getvalue().to_pybytes()


def columns(study: Study) -> list[tuple[str, pa.DataType]]:
    """Names and types of the columns of the table of all runs."""
    own = [(axis.key, axis.values) for axis in study.every_axis]
    own += [(d.key, d.numbers if d.law == "choice" else (0.5,)) for d in study.draws]
    fixed = [("run", pa.int64()), ("scenario", pa.string()), ("seed", pa.int64())]
    named = {name for name, _ in fixed}
    return [
        *fixed,
        *((key, _type(values)) for key, values in own if key not in named),
        ("outcome", pa.string()), ("success", pa.bool_()), ("missed", MISSED),
        *((name, pa.float64()) for name in (*MEANINGS, "track_ms")),
        *((name, pa.string()) for name in version_columns()),
    ]  # fmt: skip


def _cell(value: Any, kind: pa.DataType) -> Any:
    """A value for a column; values of an axis with mixed types are stored as text."""
    return value if kind != pa.string() or value is None else str(value)


def _type(values: Iterable[Any]) -> pa.DataType:
    kinds = {type(v) for v in values}
    if kinds == {bool}:
        return pa.bool_()
    if kinds == {int}:
        return pa.int64()
    return pa.float64() if kinds <= {int, float} else pa.string()
