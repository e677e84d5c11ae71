"""Reading what other commands wrote: a file that is missing or broken is a mistake, told once."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeVar

import pyarrow as pa
import pyarrow.parquet as pq
from pydantic import TypeAdapter, ValidationError

from servo.mistake import Mistake
from tracking.evaluation import reading

Content = TypeVar("Content")
HALF = "it may be half-written"
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
        file = pq.ParquetFile(pa.BufferReader(raw))
        for name in wanted or ():
            if name not in file.schema_arrow.names:
                raise Mistake(f"{path}: there is no column '{name}' in this table")
        return file.read(columns=None if wanted is None else list(wanted))
    except (pa.ArrowInvalid, OSError):
        raise Mistake(f"{path}: this is no Parquet table; {HALF}") from None


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
