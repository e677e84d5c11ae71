"""Destinations of a Rerun recording: a file or a notebook. The module `live` has the third, a
viewer.
"""

import ctypes
import inspect
import shutil
from abc import ABC, abstractmethod
from pathlib import Path
from typing import final

import rerun as rr
import rerun.blueprint as rrb

from servo.mistake import Refused
from sim.stderr import silent_libraries

PATIENCE = 10.0
"""Time after which a destination that has not taken the data counts as failed [s]."""
FULL = 1 << 16
"""A disk with less free space counts as full [bytes]."""
ROOM = 1 << 18
"""Free space that a recording needs when it begins [bytes]."""


def new_stream(app: str, name: str | None) -> rr.RecordingStream:
    """Return a new Rerun stream, without a destination and with only those timelines that the
    caller logs; from now on, Rerun raises its errors in this process (strict mode).

    Args:
        app: Rerun's name of the application.
        name: Identifier of the recording, which viewers show as its name; None: a random one.
    """
    rr.set_strict_mode(True)
    stream = rr.RecordingStream(app, recording_id=name)
    if hasattr(stream, "set_log_time_enabled"):  # Rerun 0.33 has not
        stream.set_log_time_enabled(False)
        stream.set_log_tick_enabled(False)
    return stream


class Recording(ABC):
    """Base class of the destinations of a Rerun recording: a file, a notebook or a viewer."""

    _stream: rr.RecordingStream

    @abstractmethod
    def begin(self, app: str, blueprint: rrb.Blueprint) -> rr.RecordingStream:
        """Open the destination, and return the stream to log to.

        Args:
            app: Rerun's name of the application.
            blueprint: Layout of the viewer.

        Raises:
            OSError: The file of a recording cannot be written.
        """

    def refusal(self) -> Refused:
        """Return the error that `flush` raises when the destination does not take the logged data
        within 10 s.
        """
        return Refused("Rerun takes no more data; run the command again")

    def flush(self) -> None:
        """Wait until all logged data has arrived.

        Raises:
            Refused: The data does not arrive within 10 s; earlier data can be read.
        """
        try:
            self._stream.flush(timeout_sec=PATIENCE)
        except RuntimeError:
            raise self.refusal() from None

    def close(self) -> None:
        """Send the last data, and disconnect the stream.

        Raises:
            Refused: The data does not arrive within 10 s; earlier data can be read.
        """
        self.flush()
        self._stream.disconnect()

    def abandon(self) -> None:
        """End the recording after an error, at once. The stream is kept alive until the process
        ends, as deleting it would wait for ever for bytes that the disk refuses.
        """
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(self._stream))
        rr.unregister_shutdown()


@final
class RecordingFile(Recording):
    """A recording in a file (.rrd); viewers show the name of the file's folder."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def begin(self, app: str, blueprint: rrb.Blueprint) -> rr.RecordingStream:
        """Create the file; return the stream to log to.

        Raises:
            OSError: The disk has no 256 kB left; Rerun would wait for ever.
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
        """Return the error that the recording ends too early, because the disk is full or refuses
        more data.
        """
        full = shutil.disk_usage(self.path.parent).free < FULL
        why = (
            "the disk is full"
            if full
            else "the disk refuses more (is a quota or a limit of file sizes reached?)"
        )
        return Refused(f"{self.path}: the recording ends too early: {why}")


def footer_is_optional() -> bool:
    """Return whether this version of Rerun can leave out the footer of a file."""
    return "write_footer" in inspect.signature(rr.save).parameters


class NotebookRecording(Recording):
    """A recording in memory, which a notebook displays when the recording is complete."""

    def begin(self, app: str, blueprint: rrb.Blueprint) -> rr.RecordingStream:
        """Return a stream whose data stays in memory."""
        self._stream = new_stream(app, None)
        self._blueprint = blueprint
        return self._stream

    def flush(self) -> None:
        """Do nothing: the data stays in memory until `close`."""

    def close(self) -> None:
        """Display the recording in the notebook's cell."""
        from rerun.notebook import Viewer  # of the extra "notebook"

        Viewer(recording=self._stream, blueprint=self._blueprint).display()

    def abandon(self) -> None:
        """Do nothing: the recording is not displayed."""
