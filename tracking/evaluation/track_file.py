"""Writing and reading of tracks (a tracker's estimates for all pictures of a source) as CSV files
with a row for each picture.
"""

import csv
import io
from decimal import Decimal
from pathlib import Path

import numpy as np

from sim.files import reading
from tracking.evaluation.track import Shot, Track
from tracking.files import atomic
from tracking.types import Region

FORMAT = 3
"""Version of the format; `HEADER` identifies it, and it increases with each change."""
HEADER = (
    "frame",
    "time",
    "x",
    "y",
    "theta",
    "scale",
    "width",
    "height",
    "x1",
    "y1",
    "x2",
    "y2",
    "x3",
    "y3",
    "x4",
    "y4",
    "confidence",
    "status",
    "milliseconds",
    "stamp",
    "name",
)
CORNERS = slice(HEADER.index("x1"), HEADER.index("y4") + 1)
"""Columns of the corners."""
DIGITS = 9
"""Significant digits of numbers."""
LARGEST = 1_000_000_000
"""Largest file that is read [bytes]."""


class TrackFile:
    """Writer of a CSV file with a tracker's estimates, a row for each picture; each row is in the
    file when `add` returns. `region` is the size of the target in the first picture [px].
    """

    def __init__(self, path: Path, region: Region) -> None:
        """Open a new file, in place of an older one, and write its header.

        Args:
            path: The file.
            region: Size of the target in the first picture [px].

        Raises:
            OSError: The file cannot be written.
        """
        self._path = path
        self._region = region
        self._file = io.TextIOWrapper(
            atomic.new_file(path), "utf-8", errors="backslashreplace", newline=""
        )  # names of pictures may hold bytes that are not UTF-8
        self._writer = csv.writer(self._file, lineterminator="\n")
        self._writer.writerow(HEADER)

    def add(self, shot: Shot) -> None:
        """Write the row of a picture with the tracker's estimate for it.

        Raises:
            OSError: The file cannot be written.
        """
        state = shot.estimate.state
        numbers = [
            state.x,
            state.y,
            state.theta,
            state.scale,
            self._region.width * state.scale,
            self._region.height * state.scale,
            *shot.estimate.outline(self._region).ravel().tolist(),
        ]
        row = [
            shot.index,
            f"{shot.picture.time:.6f}",
            *(f"{number:.{DIGITS}g}" for number in numbers),
            f"{shot.confidence:.6f}",
            shot.estimate.status.name,
            f"{1e3 * shot.seconds:.3f}",
            stamp_text(shot.picture.stamp),
            shot.picture.name,
        ]
        with atomic.naming(self._path):
            self._writer.writerow(row)
            self._file.flush()

    def close(self) -> None:
        """Close the CSV file; `add` must not be called any more.

        Raises:
            OSError: The last rows cannot be written.
        """
        with atomic.naming(self._path):
            self._file.close()


def stamp_text(stamp: int | None) -> str:
    """Return a time stamp [ns] as text in seconds with nine decimals; an empty text for None.

    >>> stamp_text(1_700_000_000_250_000_001)
    '1700000000.250000001'
    """
    return "" if stamp is None else f"{Decimal(stamp).scaleb(-9):f}"


def read(path: Path) -> Track:
    """Return the track (a tracker's estimates) in a CSV file that `TrackFile` wrote; its
    `evaluations` are nan, because the file has none.

    Raises:
        ValueError: The file cannot be read, or is not a track of this format.
    """
    text = reading.text(path, "track", LARGEST)
    try:
        header, *rows = csv.reader(io.StringIO(text, newline=""))
    except (ValueError, csv.Error):
        raise ValueError(
            f"{path}: this is not a track file: name one that `servobench track` wrote"
        ) from None
    if tuple(header) != HEADER:
        raise ValueError(
            f"{path}: this file does not have the columns of a track of format {FORMAT}, which "
            f"this version reads, but {', '.join(header)}; run `servobench track` again with this "
            "version"
        )
    try:
        return _track(rows)
    except (ValueError, IndexError):
        raise ValueError(
            f"{path}: a row of this track lacks a number, or has a text in its place: run "
            "`servobench track` again"
        ) from None


def _track(rows: list[list[str]]) -> Track:
    """Return the track in the rows of a file, whose columns are `HEADER`."""

    def columns(*names: str) -> np.ndarray:
        found = [[float(row[HEADER.index(name)]) for name in names] for row in rows]
        return np.array(found).reshape(-1, len(names))

    return Track(
        columns("x", "y", "theta", "scale"),
        columns(*HEADER[CORNERS]).reshape(-1, 4, 2),
        columns("confidence")[:, 0],
        columns("milliseconds")[:, 0],
        np.full(len(rows), np.nan),
    )
