"""The files of a track: rows, report, and optionally a video and a recording."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from servo.mistake import Refused
from servo.output.formats import Made, Number
from sim.types import Array
from tracking.evaluation.drawing.annotated_video import AnnotatedVideo
from tracking.evaluation.track import Shot
from tracking.evaluation.track_file import TrackFile
from tracking.types import Region

if TYPE_CHECKING:
    from servo.output.recording.track_log import TrackLog

TRACK, VIDEO, RECORDING = "track.csv", "track.mp4", "track.rrd"
SPARE = 1 << 18
"""Free space that is kept for rows and report; with less, the other files end [bytes]."""


class TrackFolder:
    """Writer of the shots of one track; a video or recording that fails does not stop the rows."""

    refused: Refused | None = None
    """Why the video or the recording is not complete; None if both are."""

    def __init__(
        self, folder: Path, region: Region, rate: float, *, video: bool, recording: bool
    ) -> None:
        """Open the files; `rate` is in pictures a second.

        Raises:
            OSError: A file cannot be written.
        """
        self._folder, self._at_once = folder, max(1, round(rate))
        self._rows = TrackFile(folder / TRACK, region)
        self._extras: dict[Path, AnnotatedVideo | TrackLog] = {}
        if video:
            self._extras[folder / VIDEO] = AnnotatedVideo(folder / VIDEO, rate, region)
        if recording:
            # rerun takes half a second to import
            from servo.output.recording.track_log import TrackLog

            self._extras[folder / RECORDING] = TrackLog(folder / RECORDING, region, rate)
        self.paths = [folder / TRACK, *self._extras]

    def add(self, shot: Shot, truth: Array | None) -> None:
        """Write a shot, and the truth of its picture (4, 2) if there is one.

        Raises:
            OSError: The row cannot be written.
        """
        self._rows.add(shot)
        full = self._extras and shot.index % self._at_once == 0 and self._nearly_full()
        for path, extra in list(self._extras.items()):
            if full:
                self._end(path, "the disk is full")
            else:
                self._guarded(path, lambda extra=extra: extra.add(shot, truth))

    def close(self) -> None:
        """Finish all files.

        Raises:
            OSError: The last rows cannot be written.
        """
        try:
            self._rows.close()
        finally:
            for path, extra in list(self._extras.items()):
                self._guarded(path, extra.close)

    def _guarded(self, path: Path, act: Callable[[], None]) -> None:
        try:
            act()
        except OSError as error:
            self._end(path, error.strerror or str(error))
        except Refused as error:
            self._end(path, str(error).rpartition(": ")[2])

    def _end(self, path: Path, reason: str) -> None:
        self._extras.pop(path).abandon()
        self.refused = self.refused or Refused(f"{path}: it ends too early: {reason}")

    def _nearly_full(self) -> bool:
        return shutil.disk_usage(self._folder).free < SPARE


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackReport(Made):
    """Source, tracker, losses and measures of a track."""

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
    measures: dict[str, Number | None]
    """Values of the measures by name, None if not finite; empty without a truth."""
    units: dict[str, str]
    """Units of the measures by name."""
    end: str = ""
    """How the source ended, where that is worth a sentence: a lost stream, a damaged bag."""
    dropped: int = 0
    """Pictures of a stream that the tracker never saw, because it was slower."""
