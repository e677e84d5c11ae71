"""Writer of the files of a track (a tracker's estimates for a sequence of pictures): rows as CSV
and as Parquet, and optionally a recording and other outputs; and the contents of its report.
"""

import shutil
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import pyarrow as pa
import pyarrow.parquet as pq
from pyarrow import csv

from servo.closing import closing
from servo.mistake import Refused
from servo.output.formats import Made, Number
from servo.output.sinks import Sink, Sinks
from sim.types import Array
from tracking.evaluation.track import Shot
from tracking.evaluation.track_file import HEADER, TrackFile
from tracking.files import atomic
from tracking.types import Region

TRACK = "track.csv"
TABLE = "track.parquet"
NUMBERS = (*HEADER[1 : HEADER.index("status")], "milliseconds")
"""Columns of a track with numbers that need not be whole."""
STAMP = pa.decimal128(19, 9)
"""Type of a stamp [s], whose digits all count."""
RECORDING = "track.rrd"
SPARE = 1 << 18
"""Free space that is kept for rows and report; with less, the other files end [bytes]."""


class TrackFolder:
    """Writer of the files of one track: a row for each picture to track.csv, the same rows to
    track.parquet at the end, a Rerun recording if `recording`, and other outputs such as a film
    (`more`, by path of the file or name). If the recording or another output fails, the rows are
    still written. `region` is the target's region in the first picture.
    """

    def __init__(
        self,
        folder: Path,
        region: Region,
        *,
        recording: bool,
        more: Mapping[Path | str, Sink] | None = None,
    ) -> None:
        """Open the files.

        Args:
            folder: An existing folder.
            region: The target's region in the first picture.
            recording: Whether to write a recording.
            more: Other sinks of pictures and estimates, by path of their file or by name.

        Raises:
            OSError: The file track.csv cannot be written.
        """
        self.count = 0
        """Number of rows; 0 before `close`."""
        self.seconds = 0.0
        """Wall-clock time that writing and showing the shots has taken so far [s]."""
        self._folder = folder
        self._rows = TrackFile(folder / TRACK, region)
        self._sinks = Sinks(more or {})
        if recording:
            # rerun takes half a second to import
            from servo.output.recording.destination import RecordingFile
            from servo.output.recording.track_log import TrackLog

            path = folder / RECORDING
            self._sinks.begin(path, lambda: TrackLog(RecordingFile(path), region))

    @property
    def paths(self) -> list[Path]:
        """Paths of track.csv, track.parquet (which exists after `close`), and the files of all
        other outputs but those that failed.
        """
        return [self._folder / TRACK, self._folder / TABLE, *self._sinks.paths]

    @property
    def refused(self) -> Refused | None:
        """Error of the first output that failed besides the rows, such as a film; None if none
        has.
        """
        return self._sinks.refused

    def add(self, shot: Shot, truth: Array | None) -> None:
        """Write a tracked picture and its estimate. If less than 256 kB are free on the disk, all
        outputs but the rows are ended.

        Args:
            shot: The picture with its estimate.
            truth: True corners (4, 2) of the target [px]; None: unknown.

        Raises:
            OSError: The row cannot be written.
        """
        began = time.monotonic()
        self._rows.add(shot)
        if self._sinks and shutil.disk_usage(self._folder).free < SPARE:
            self._sinks.end("the disk is full")
        self._sinks.add(shot, truth)
        self.seconds += time.monotonic() - began

    def close(self) -> None:
        """Finish all files, and write the rows of track.csv as track.parquet.

        Raises:
            OSError: The last rows, or track.parquet, cannot be written.
        """
        with closing(self._sinks.close):
            self._rows.close()
            rows = _rows(self._folder / TRACK)
            self.count = rows.num_rows
            with atomic.writing(self._folder, TABLE) as file:
                pq.write_table(rows, file)


def _rows(file: Path) -> pa.Table:
    """Return the rows of a track's CSV file, in which a picture's name may hold any character."""
    # The same types for each track, also where all values happen to be whole numbers.
    types = dict.fromkeys(NUMBERS, pa.float64()) | {"stamp": STAMP, "name": pa.string()}
    options = csv.ConvertOptions(column_types=types)
    lines = csv.ParseOptions(newlines_in_values=True)
    return csv.read_csv(file, parse_options=lines, convert_options=options)


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackReport(Made):
    """The contents of the file report.json of a track: source of the pictures and remarks on it,
    kind, settings and seed of the tracker, numbers of frames, and measures by name with their units
    (no measures if the target's true outlines are unknown).
    """

    FILE: ClassVar[str] = "report.json"
    KIND: ClassVar[str] = "track"

    source: str
    tracker: dict[str, Any]
    """Kind and settings that were given."""
    seed: int
    frames: int
    undecodable: list[str]
    """Names of the pictures that could not be read."""
    lost: int
    """Number of frames with status LOST."""
    unsure: int = 0
    """Number of frames with status UNSURE."""
    measures: dict[str, Number | None]
    """Values of the measures by name, None if not finite; empty without a truth."""
    units: dict[str, str]
    """Units of the measures by name."""
    end: str = ""
    """A sentence about the end of the source, if there is something to say, such as that a stream
    broke off or a bag is damaged; else ""."""
    start: Number | None = None
    """Stamp of the first picture that has one [s], as its bag or video states it (rounded; exact in
    track.csv); None: no picture has one."""
    began: str = ""
    """When the first picture of a live source came, by this machine's clock (ISO 8601, UTC); "" for
    other sources."""
    dropped: int = 0
    """Number of pictures of a stream that came while the tracker was busy, and were not used."""
    damaged: int = 0
    """Number of damaged pictures; of a stream, including those that cannot be decoded."""
    notes: list[str] = field(default_factory=list[str])
    """Sentences about the pictures, such as the bits that they use."""
