"""A recording's file: it grows on the disk while it is written, and says when it cannot."""

from __future__ import annotations

import ctypes
import shutil
from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb

from servo.mistake import Refused

PATIENCE = 10.0
"""A disk that takes nothing for so long refuses [s]."""
FULL = 1 << 16
"""A disk with less room than this is full [bytes]."""


class RecordingFile:
    """A recording stream that goes to one file."""

    def __init__(self, app: str, path: Path, blueprint: rrb.Blueprint) -> None:
        """Begin a recording named like its folder."""
        rr.set_strict_mode(True)
        self.path = path
        self.stream = rr.RecordingStream(app, recording_id=path.parent.name)
        self.stream.save(path, default_blueprint=blueprint)
        self.stream.set_log_time_enabled(False)
        self.stream.set_log_tick_enabled(False)

    def flush(self) -> None:
        """Wait until all that was logged is in the file.

        Raises:
            Refused: The disk takes no more; what was written before can be opened.
        """
        try:
            self.stream.flush(timeout_sec=PATIENCE)
        except RuntimeError:
            # Deleting the stream, and Rerun's own end, would wait for ever for the last bytes.
            ctypes.pythonapi.Py_IncRef(ctypes.py_object(self.stream))
            rr.unregister_shutdown()
            full = shutil.disk_usage(self.path.parent).free < FULL
            why = "the disk is full" if full else "the disk refuses more"
            raise Refused(f"{self.path}: the recording ends too early: {why}") from None

    def close(self) -> None:
        """Write what is left and the footer.

        Raises:
            Refused: As for `flush`; the file then stays as it is, because Rerun would wait for ever
                for its last bytes.
        """
        self.flush()
        self.stream.disconnect()
