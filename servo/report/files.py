"""Reader of the Parquet tables that other commands write."""

from __future__ import annotations

from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from servo.mistake import Mistake
from servo.output.formats import HALF, check_format, content


def table(path: Path, number: int | None = None) -> pa.Table:
    """Return the table in a Parquet file.

    Args:
        path: The file.
        number: The format number that it must have; None: it has none.

    Raises:
        Mistake: It cannot be read, is half-written, or has another format number.
    """
    raw = pa.BufferReader(content(path))
    try:
        found = pq.read_table(raw, page_checksum_verification=True)
    except (pa.ArrowException, OSError, ValueError, OverflowError, MemoryError):
        raise Mistake(f"{path}: this is not a Parquet table; {HALF}") from None
    if number is not None:
        written = (found.schema.metadata or {}).get(b"format", b"").decode(errors="replace")
        check_format(path, int(written) if written.isdecimal() else written or None, number)
    return found
