"""Destinations of a recording: a file, or a notebook; `live` has the viewers."""

import ctypes
import inspect
import shutil
from abc import ABC, abstractmethod
from pathlib import Path
from typing import Protocol, final

import rerun as rr
import rerun.blueprint as rrb

from servo.mistake import Refused
from sim.stderr import silent_libraries

PATIENCE = 10.0
"""Longest time that the disk may take; after it, the disk counts as not writable [s]."""
FULL = 1 << 16
"""A disk with less free space counts as full [bytes]."""
ROOM = 1 << 18
"""Free space that a recording needs when it begins [bytes]."""


class Recording(Protocol):
    """The destination of a recording."""

    def begin(self, app: str, blueprint: rrb.Blueprint) -> rr.RecordingStream:
        """Open the destination; return the stream to log to."""
        ...

    def flush(self) -> None:
        """Wait until all logged data has arrived.

        Raises:
            Refused: The data does not arrive.
        """

    def close(self) -> None:
        """Send the last data, and end the recording; errors are those of `flush`."""

    def abandon(self) -> None:
        """Leave the recording as it is; wait for nothing."""


def new_stream(app: str, name: str | None) -> rr.RecordingStream:
    """Return a stream without a destination and without Rerun's own timelines.

    Args:
        app: Name of the application.
        name: Name of the recording; None: Rerun makes one.
    """
    rr.set_strict_mode(True)
    stream = rr.RecordingStream(app, recording_id=name)
    if hasattr(stream, "set_log_time_enabled"):  # Rerun 0.33 has not
        stream.set_log_time_enabled(False)
        stream.set_log_tick_enabled(False)
    return stream


class SentRecording(ABC):
    """The destination of a recording that is sent while it is made."""

    _stream: rr.RecordingStream

    @abstractmethod
    def refusal(self) -> Refused:
        """Return the error that says why logged data does not arrive."""

    def flush(self) -> None:
        """Wait until all logged data has arrived.

        Raises:
            Refused: The data does not arrive; data that arrived before can be read.
        """
        try:
            self._stream.flush(timeout_sec=PATIENCE)
        except RuntimeError:
            raise self.refusal() from None

    def close(self) -> None:
        """Send the last data, and end the stream; errors are those of `flush`."""
        self.flush()
        self._stream.disconnect()

    def abandon(self) -> None:
        """Keep the stream without ending it, so that this process can end: deleting the stream, and
        Rerun's shutdown, would wait for ever for bytes that the disk refuses.
        """
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(self._stream))
        rr.unregister_shutdown()


@final
class RecordingFile(SentRecording):
    """The file of a recording, which has the name of the file's folder."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def begin(self, app: str, blueprint: rrb.Blueprint) -> rr.RecordingStream:
        """Open the file; return the stream to log to.

        Raises:
            OSError: The disk has no room for the file; Rerun would wait for ever.
        """
        try:
            self.path.write_bytes(bytes(ROOM))
        except OSError:
            self.path.unlink(missing_ok=True)
            raise
        self._stream = new_stream(app, self.path.parent.name)
        # Rerun would keep the index of a footer in memory, which grows with the run.
        index = {"write_footer": False} if footer_is_optional() else {}
        with silent_libraries():  # Rerun warns that the file has no footer
            self._stream.save(self.path, default_blueprint=blueprint, **index)
        return self._stream

    def refusal(self) -> Refused:
        """Return the error of a disk that cannot be written."""
        full = shutil.disk_usage(self.path.parent).free < FULL
        why = "the disk is full" if full else "the disk refuses more"
        return Refused(f"{self.path}: the recording ends too early: {why}")


def footer_is_optional() -> bool:
    """Return whether this version of Rerun can leave out the footer of a file."""
    return "write_footer" in inspect.signature(rr.save).parameters


class NotebookRecording:
    """A recording in memory, which a notebook displays when the recording is complete."""

    def begin(self, app: str, blueprint: rrb.Blueprint) -> rr.RecordingStream:
        """Begin a recording in memory; return the stream to log to."""
        self._stream = new_stream(app, None)
        self._blueprint = blueprint
        return self._stream

    def flush(self) -> None:
        """Do nothing: the recording stays in memory until its end."""

    def close(self) -> None:
        """Display the recording; do not wait for a browser to open."""
        from rerun.notebook import Viewer  # of the extra "notebook"

        Viewer(recording=self._stream, blueprint=self._blueprint).display()

    def abandon(self) -> None:
        """Do nothing: the recording is not displayed."""
