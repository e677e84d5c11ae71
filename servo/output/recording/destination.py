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
    """Return a new Rerun stream without a destination, which has only those timelines that the
    caller logs (Rerun 0.33 adds its own).

    From now on, Rerun raises its errors in this process (strict mode).

    Args:
        app: Name of the application, for Rerun.
        name: Identifier of the recording, which viewers show as its name; None: a random one.
    """
    rr.set_strict_mode(True)
    stream = rr.RecordingStream(app, recording_id=name)
    if hasattr(stream, "set_log_time_enabled"):  # Rerun 0.33 has not
        stream.set_log_time_enabled(False)
        stream.set_log_tick_enabled(False)
    return stream


class Recording(ABC):
    """Base class of the destinations of a Rerun recording (a file, a notebook or a viewer): `begin`
    returns the stream to which data are logged, and `close` ends it.
    """

    _stream: rr.RecordingStream

    @abstractmethod
    def begin(self, app: str, blueprint: rrb.Blueprint) -> rr.RecordingStream:
        """Open the destination, and return the Rerun stream to which data are then logged.

        Args:
            app: Name of the application, for Rerun.
            blueprint: Layout of the viewer.

        Raises:
            OSError: The file of a recording cannot be written.
        """

    def refusal(self) -> Refused:
        """Return the error that `flush` and `close` raise when the destination does not take the
        logged data within 10 s.
        """
        return Refused("Rerun takes no more data; run the command again")

    def flush(self) -> None:
        """Wait until all logged data has arrived at the destination.

        Raises:
            Refused: The data does not arrive within 10 s; data that arrived before can be read.
        """
        try:
            self._stream.flush(timeout_sec=PATIENCE)
        except RuntimeError:
            raise self.refusal() from None

    def close(self) -> None:
        """Send the last data to the destination, and disconnect the stream.

        Raises:
            Refused: The data does not arrive within 10 s; data that arrived before can be read.
        """
        self.flush()
        self._stream.disconnect()

    def abandon(self) -> None:
        """End the recording after an error, without waiting. The stream is kept alive until the
        process ends, because deleting it would wait for ever if the disk refuses its last data.
        """
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(self._stream))
        rr.unregister_shutdown()


@final
class RecordingFile(Recording):
    """A Rerun recording in a file (.rrd). Viewers show the name of the file's folder as the
    recording's name.
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    def begin(self, app: str, blueprint: rrb.Blueprint) -> rr.RecordingStream:
        """Create the file, and return the Rerun stream whose data is written into it.

        Args:
            app: Name of the application, for Rerun.
            blueprint: Layout of the viewer, which is stored in the file.

        Raises:
            OSError: The file cannot be written, or the disk has less than 256 kB left.
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
        """Return the error that the recording ends too early, because the disk is full (less than
        64 kB are free) or refuses more data for another reason.
        """
        full = shutil.disk_usage(self.path.parent).free < FULL
        why = (
            "the disk is full"
            if full
            else "the disk refuses more (is a quota or a limit of file sizes reached?)"
        )
        return Refused(f"{self.path}: the recording ends too early: {why}")


def footer_is_optional() -> bool:
    """Return whether the installed version of Rerun can leave out the footer (an index) of a
    file.
    """
    return "write_footer" in inspect.signature(rr.save).parameters


class NotebookRecording(Recording):
    """A Rerun recording in memory, which a notebook displays when the recording is complete."""

    def begin(self, app: str, blueprint: rrb.Blueprint) -> rr.RecordingStream:
        """Return a Rerun stream whose data stays in memory; `blueprint` is the layout with which it
        is displayed later.
        """
        self._stream = new_stream(app, None)
        self._blueprint = blueprint
        return self._stream

    def flush(self) -> None:
        """Do nothing: the data stays in memory until `close`."""

    def close(self) -> None:
        """Display the recording, with its layout, in the notebook's cell."""
        from rerun.notebook import Viewer  # of the extra "notebook"

        Viewer(recording=self._stream, blueprint=self._blueprint).display()

    def abandon(self) -> None:
        """Do nothing: the recording is not displayed."""
