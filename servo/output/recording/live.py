"""A recording that is watched while it is made: in Rerun's window, or in a browser.

A process beside this one serves what is logged, to this machine alone. So a viewer may be closed
and opened again, and one that comes late gets everything; the process ends with this one.
"""

import socket
import subprocess
import sys
import time
import webbrowser
from pathlib import Path
from typing import final
from urllib.parse import quote

import rerun as rr
import rerun.blueprint as rrb
import rerun_cli

from servo.mistake import Mistake, Refused
from servo.output.display import has_display
from servo.output.recording.destination import SentRecording, new_stream

HOST = "127.0.0.1"
EVERY = 0.02
"""Time between two batches of data: pictures that come more slowly are sent one by one [s]."""
STARTS_WITHIN = 20.0
POLL = 0.05
"""Longest time that the server may take to start, and between two looks at it [s]."""
UNTIL_CLOSED = (
    "import subprocess, sys\n"
    "server = subprocess.Popen(sys.argv[1:])\n"
    "sys.stdin.read()\n"
    "server.terminate()\n"
    "server.wait()\n"
)
"""Runs a command until stdin is closed, by us or by our end, whatever ends us."""


@final
class LiveViewer(SentRecording):
    """A viewer, and the server that it gets a recording from."""

    def __init__(self, *, web: bool, port: int) -> None:
        """Start both: the data is served at a port, the page of a browser at the next one.

        Raises:
            Mistake: A port is in use, or there is no display for a window.
            Refused: The server does not start.
        """
        if not web and not has_display():
            raise Mistake("there is no display here: use --live --web to watch in a browser")
        ports = [port, port + 1] if web else [port]
        _check_free(ports, port)
        self.source = f"rerun+http://{HOST}:{port}/proxy"
        self.page = f"http://{HOST}:{port + 1}/?url={quote(self.source, safe='')}" if web else None
        more = ["--serve-web", "--web-viewer-port", str(port + 1)] if web else ["--serve-grpc"]
        program = Path(rerun_cli.__file__).parent / f"rerun{'.exe' * (sys.platform == 'win32')}"
        command = [str(program), *more, "--bind", HOST, "--port", str(port)]
        self._server = subprocess.Popen(
            [sys.executable, "-c", UNTIL_CLOSED, *command],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,  # Ctrl-C is for us: the last pictures are still to be sent
        )
        self._wait_for(ports)
        self._window = None
        if self.page is None:
            self._window = subprocess.Popen(
                [str(program), self.source],
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                start_new_session=True,
            )
        elif has_display():
            webbrowser.open(self.page)

    def _wait_for(self, ports: list[int]) -> None:
        end = time.monotonic() + STARTS_WITHIN
        for port in ports:
            while not _listens(port):
                if time.monotonic() > end or self._server.poll() is not None:
                    self.stop()
                    raise Refused(f"Rerun's server does not start at port {port}")
                time.sleep(POLL)

    def begin(self, app: str, blueprint: rrb.Blueprint) -> rr.RecordingStream:
        """Begin a recording."""
        self._stream = new_stream(app, None)
        self._stream.connect_grpc(self.source, default_blueprint=blueprint)
        return self._stream

    def refusal(self) -> Refused:
        """The server is gone."""
        return Refused("the viewer: Rerun's server is gone")

    def wait(self) -> None:
        """Serve until the window is closed; for a browser, until Ctrl-C."""
        while self._window is None or self._window.poll() is None:
            time.sleep(POLL)

    def stop(self) -> None:
        """Stop serving."""
        if self._server.stdin is not None:
            self._server.stdin.close()
        self._server.wait()


def _check_free(ports: list[int], first: int) -> None:
    for port in ports:
        with socket.socket() as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind((HOST, port))
            except OSError:
                raise Mistake(
                    f"--port {first}: port {port} is in use; choose another one with --port"
                ) from None


def _listens(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex((HOST, port)) == 0
