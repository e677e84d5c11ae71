"""Conversion of rows of values to the text of a CSV file."""

import csv
import io
from collections.abc import Iterable, Sequence


def csv_text(head: Sequence[object], rows: Iterable[Sequence[object]]) -> str:
    """Return the text of a CSV file: a header with the columns' names, and rows of values, with
    None as an empty cell.
    """
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(head)
    table.writerows(rows)
    return text.getvalue()
