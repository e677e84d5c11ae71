"""Reading what other commands wrote: a file that is missing or damaged is a mistake."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, TypeVar

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from annotated_types import Ge, Le
from pydantic import TypeAdapter, ValidationError

from servo.mistake import Mistake
from tracking.files import reading

Content = TypeVar("Content")
HALF = "it may be half-written"
ABSURD = 1e100
"""No number of ours is larger; what is larger cannot be drawn."""
Number = Annotated[float, Ge(-ABSURD), Le(ABSURD)]
LARGEST = 1_000_000_000
"""Largest file [bytes]."""


def read(path: Path, kind: type[Content]) -> Content:
    """A JSON file as a dataclass; keys that it does not have are passed over.

    Raises:
        Mistake: The file cannot be read, is no JSON, or lacks something.
    """
    try:
        return TypeAdapter(kind).validate_json(content(path))
    except ValidationError as error:
        first = error.errors()[0]
        if first["type"] == "json_invalid":
            raise Mistake(f"{path}: this is not JSON; {HALF}") from None
        where = ".".join(str(part) for part in first["loc"]) or "all of it"
        said = first["msg"][0].lower() + first["msg"][1:]
        raise Mistake(f"{path}: {where}: {said}") from None


def content(path: Path) -> bytes:
    """A file's bytes.

    Raises:
        Mistake: It cannot be read, is not a regular file, or is too large.
    """
    try:
        return reading.content(path, "file", LARGEST)
    except ValueError as error:
        raise Mistake(str(error)) from None


def table(path: Path, wanted: Sequence[str] | None = None) -> pa.Table:
    """A Parquet file, or some of its columns.

    Raises:
        Mistake: It cannot be read, or lacks a column.
    """
    raw = content(path)
    try:
        file = pq.ParquetFile(pa.BufferReader(raw), page_checksum_verification=True)
        for name in wanted or ():
            if name not in file.schema_arrow.names:
                raise Mistake(f"{path}: there is no column '{name}' in this table")
        found = file.read(columns=None if wanted is None else list(wanted))
    except Mistake:
        raise
    except (pa.ArrowException, OSError, ValueError, OverflowError, MemoryError):
        raise Mistake(f"{path}: this is no Parquet table; {HALF}") from None
    for name, column in zip(found.column_names, found.columns, strict=True):
        if pa.types.is_floating(column.type) and _absurd(column):
            raise Mistake(f"{path}: the column '{name}' holds a number beyond {ABSURD:g}")
    return found


def _absurd(column: pa.ChunkedArray) -> bool:
    """Whether a finite number is too large; inf and nan are said of what has no value."""
    values = np.asarray(column.to_numpy(), float)
    return bool((np.abs(values[np.isfinite(values)]) > ABSURD).any())


def rows(path: Path) -> list[dict[str, Any]]:
    """A CSV file with a head, a row a line.

    Raises:
        Mistake: It cannot be read, or is no text.
    """
    try:
        text = content(path).decode("utf-8")
    except UnicodeDecodeError:
        raise Mistake(f"{path}: this is not UTF-8 text") from None
    return list(csv.DictReader(text.splitlines()))
