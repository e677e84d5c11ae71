"""Destinations of a recording: a file, or a notebook; `live` has the viewers."""

import ctypes
import shutil
from abc import ABC, abstractmethod
from pathlib import Path
from typing import Protocol, final

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
    if hasattr(stream, "set_log_time_enabled"):  # Rerun 0.33 has not
        stream.set_log_time_enabled(False)
        stream.set_log_tick_enabled(False)
    return stream


class SentRecording(ABC):
    """A recording that is sent while it is made."""

    _stream: rr.RecordingStream

    @abstractmethod
    def refusal(self) -> Refused:
        """The reason why what was logged does not arrive."""

    def flush(self) -> None:
        """Wait until everything that was logged has arrived.

        Raises:
            Refused: It does not; what arrived before can be read.
        """
        try:
            self._stream.flush(timeout_sec=PATIENCE)
        except RuntimeError:
            raise self.refusal() from None

    def close(self) -> None:
        """Send the last data, and end; errors are those of `flush`."""
        self.flush()
        self._stream.disconnect()

    def abandon(self) -> None:
        """Never end the stream: deleting it, and Rerun's shutdown, would wait for its last bytes
        for ever where they cannot be written.
        """
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(self._stream))
        rr.unregister_shutdown()


@final
class RecordingFile(SentRecording):
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

    def refusal(self) -> Refused:
        """The disk cannot be written."""
        full = shutil.disk_usage(self.path.parent).free < FULL
        why = "the disk is full" if full else "the disk refuses more"
        return Refused(f"{self.path}: the recording ends too early: {why}")


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
