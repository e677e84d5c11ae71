"""The file of a recording, which grows while it is written and reports a full disk."""

from __future__ import annotations

import ctypes
import shutil
from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb

from servo.mistake import Refused

PATIENCE = 10.0
"""Longest wait for the disk, which then counts as not writable [s]."""
FULL = 1 << 16
"""A disk with less free space counts as full [bytes]."""


class RecordingFile:
    """A recording stream that writes to one file."""

    def __init__(self, app: str, path: Path, blueprint: rrb.Blueprint) -> None:
        """Start a recording with the name of its folder."""
        rr.set_strict_mode(True)
        self.path = path
        self.stream = rr.RecordingStream(app, recording_id=path.parent.name)
        self.stream.save(path, default_blueprint=blueprint)
        self.stream.set_log_time_enabled(False)
        self.stream.set_log_tick_enabled(False)

    def flush(self) -> None:
        """Wait until everything that was logged is in the file.

        Raises:
            Refused: The disk cannot be written; the part written before can be opened.
        """
        try:
            self.stream.flush(timeout_sec=PATIENCE)
        except RuntimeError:
            # Deleting the stream, and Rerun's shutdown, would wait for the last bytes for ever.
            ctypes.pythonapi.Py_IncRef(ctypes.py_object(self.stream))
            rr.unregister_shutdown()
            full = shutil.disk_usage(self.path.parent).free < FULL
            why = "the disk is full" if full else "the disk refuses more"
            raise Refused(f"{self.path}: the recording ends too early: {why}") from None

    def close(self) -> None:
        """Write the last data and the footer.

        Raises:
            Refused: As for `flush`; the file then stays as it is.
        """
        self.flush()
        self.stream.disconnect()
