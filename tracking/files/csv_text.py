"""Texts of CSV files."""

import csv
import io
from collections.abc import Iterable, Sequence
from typing import Any


def csv_text(head: Sequence[Any], rows: Iterable[Sequence[Any]]) -> str:
    """Return the text of a CSV file with a header row and rows of cells."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(head)
    table.writerows(rows)
    return text.getvalue()
