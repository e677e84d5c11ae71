"""Destinations of a recording: a file, or a notebook; `live` has the viewers."""

import ctypes
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

import rerun as rr
import rerun.blueprint as rrb

from servo.mistake import Refused

PATIENCE = 10.0
"""Longest wait for the disk, which then counts as not writable [s]."""
FULL = 1 << 16
"""A disk with less free space counts as full [bytes]."""


ROOM = 1 << 18
"""Space that a recording needs to begin [bytes]."""


class Recording(Protocol):
    """The destination of a recording."""

    def begin(self, app: str, blueprint: rrb.Blueprint) -> rr.RecordingStream:
        """The stream to log to."""
        ...

    def flush(self) -> None:
        """Wait until everything that was logged has arrived.

        Raises:
            Refused: It cannot.
        """

    def close(self) -> None:
        """Send the last data, and end; errors are those of `flush`."""

    def abandon(self) -> None:
        """Leave everything as it is, without waiting for anything."""


def new_stream(app: str, name: str | None) -> rr.RecordingStream:
    """A stream that goes nowhere yet, of a recording with a name, without Rerun's own times."""
    rr.set_strict_mode(True)
    stream = rr.RecordingStream(app, recording_id=name)
    stream.set_log_time_enabled(False)
    stream.set_log_tick_enabled(False)
    return stream


def flushed(stream: rr.RecordingStream, refused: Callable[[], Refused]) -> None:
    """Wait until everything that was logged has arrived.

    Raises:
        Refused: It does not; what `refused` gives.
    """
    try:
        stream.flush(timeout_sec=PATIENCE)
    except RuntimeError:
        raise refused() from None


def leak(stream: rr.RecordingStream) -> None:
    """Never end a stream: deleting it, and Rerun's shutdown, would wait for its last bytes for ever
    where they cannot be written.
    """
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(stream))
    rr.unregister_shutdown()


class RecordingFile:
    """A file that a recording goes to; it has the name of its folder."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def begin(self, app: str, blueprint: rrb.Blueprint) -> rr.RecordingStream:
        """Open the file.

        Raises:
            OSError: There is no room for it; Rerun would wait for ever.
        """
        try:
            self.path.write_bytes(bytes(ROOM))
        except OSError:
            self.path.unlink(missing_ok=True)
            raise
        self._stream = new_stream(app, self.path.parent.name)
        self._stream.save(self.path, default_blueprint=blueprint)
        return self._stream

    def flush(self) -> None:
        """Wait until everything that was logged is in the file.

        Raises:
            Refused: The disk cannot be written; the part written before can be opened.
        """
        flushed(self._stream, self._refused)

    def _refused(self) -> Refused:
        full = shutil.disk_usage(self.path.parent).free < FULL
        why = "the disk is full" if full else "the disk refuses more"
        return Refused(f"{self.path}: the recording ends too early: {why}")

    def close(self) -> None:
        """Write the last data and the footer.

        Raises:
            Refused: As for `flush`; the file then stays as it is.
        """
        self.flush()
        self._stream.disconnect()

    def abandon(self) -> None:
        """Leave the file as it is."""
        leak(self._stream)


class NotebookRecording:
    """A recording in memory, which is shown in a notebook when it is complete."""

    def begin(self, app: str, blueprint: rrb.Blueprint) -> rr.RecordingStream:
        """The stream to log to."""
        self._stream = new_stream(app, None)
        self._blueprint = blueprint
        return self._stream

    def flush(self) -> None:
        """Nothing is written before the end."""

    def close(self) -> None:
        """Show it; do not wait for a browser to open."""
        from rerun.notebook import Viewer  # of the extra "notebook"

        Viewer(recording=self._stream, blueprint=self._blueprint).display()

    def abandon(self) -> None:
        """Show nothing."""
