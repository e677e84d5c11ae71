"""A recording that is shown in a notebook when it is complete."""

import rerun as rr
import rerun.blueprint as rrb

from servo.output.recording.destination import new_stream


class NotebookRecording:
    """Keeps what is logged in memory."""

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
