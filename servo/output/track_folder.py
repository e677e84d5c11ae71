"""Everything a track writes while it lasts: rows first, and with them a video and a recording."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from servo.mistake import Refused
from sim.types import Array
from tracking.evaluation.drawing.annotated_video import AnnotatedVideo
from tracking.evaluation.track import Shot
from tracking.evaluation.track_file import TrackFile
from tracking.types import Region

TRACK, VIDEO, RECORDING = "track.csv", "track.mp4", "track.rrd"
SPARE = 1 << 18
"""Room on the disk that is left for rows and report: with less the others end [bytes]."""


class Extra(Protocol):
    """A file that is written beside the rows."""

    def add(self, shot: Shot, truth: Array | None) -> None:
        """Write a picture with what the tracker found in it."""
        ...

    def close(self) -> None:
        """Finish the file."""
        ...

    def abandon(self) -> None:
        """Leave the file as it is: the disk takes no more."""
        ...


class TrackFolder:
    """Takes shots as they come. A file beside the rows that the disk refuses ends without them."""

    refused: Refused | None = None
    """Why a video or a recording is not whole, if one is not."""

    def __init__(
        self, folder: Path, region: Region, rate: float, *, video: bool, recording: bool
    ) -> None:
        """Open the files.

        Args:
            folder: Where to write.
            region: The template.
            rate: Pictures a second.
            video: Also write an annotated video.
            recording: Also write a Rerun recording.

        Raises:
            OSError: The disk refuses.
        """
        self._folder, self._at_once = folder, max(1, round(rate))
        self._rows = TrackFile(folder / TRACK, region)
        self._extras: dict[Path, Extra] = {}
        if video:
            self._extras[folder / VIDEO] = AnnotatedVideo(folder / VIDEO, rate, region)
        if recording:
            from servo.output.recording.track_log import (
                TrackLog,  # rerun takes half a second to import
            )

            self._extras[folder / RECORDING] = TrackLog(folder / RECORDING, region, rate)
        self.paths = [folder / TRACK, *self._extras]

    def add(self, shot: Shot, truth: Array | None) -> None:
        """Write a shot, and the truth of its picture (4, 2) if there is one.

        Raises:
            OSError: The disk refuses the row.
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
            OSError: The disk refuses the last rows.
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
