"""Readers of tables written by other commands, which refuse missing and damaged files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from servo.mistake import Mistake
from servo.output.formats import ABSURD, HALF, check_format, content


def table(path: Path, wanted: Sequence[str] | None = None, number: int | None = None) -> pa.Table:
    """A Parquet file, or the columns wanted of it, with its format number if it has one.

    Raises:
        Mistake: It cannot be read, has another format number, or lacks a column.
    """
    raw = content(path)
    try:
        file = pq.ParquetFile(pa.BufferReader(raw), page_checksum_verification=True)
        if number is not None:
            found = (file.schema_arrow.metadata or {}).get(b"format", b"").decode(errors="replace")
            check_format(path, int(found) if found.isdecimal() else found or None, number)
        for name in wanted or ():
            if name not in file.schema_arrow.names:
                raise Mistake(f"{path}: there is no column '{name}' in this table")
        found = file.read(columns=None if wanted is None else list(wanted))
    except Mistake:
        raise
    except (pa.ArrowException, OSError, ValueError, OverflowError, MemoryError):
        raise Mistake(f"{path}: this is not a Parquet table; {HALF}") from None
    for name, column in zip(found.column_names, found.columns, strict=True):
        if pa.types.is_floating(column.type) and _absurd(column):
            raise Mistake(f"{path}: the column '{name}' holds a number beyond {ABSURD:g}")
    return found


def _absurd(column: pa.ChunkedArray) -> bool:
    """Whether a finite number is too large; inf and nan mean that there is no value."""
    values = np.asarray(column.to_numpy(), float)
    return bool((np.abs(values[np.isfinite(values)]) > ABSURD).any())
