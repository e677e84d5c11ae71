"""Live viewers of a Rerun recording: Rerun's window, or a page in a browser.

A second process serves the logged data on 127.0.0.1. A viewer can therefore be closed and opened
again, and gets everything whenever it connects. The second process ends with this one.
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
from servo.output.local_page import has_display
from servo.output.recording.destination import Recording, new_stream

HOST = "127.0.0.1"
EVERY = 0.02
"""Time between two batches of data: pictures that come more slowly are sent one by one [s]."""
STARTS_WITHIN = 20.0
POLL = 0.05
"""Longest time that the server may take to start, and between two looks at it [s]."""
UNTIL_CLOSED = (
    "import os, subprocess, sys, threading\n"
    "server = subprocess.Popen(sys.argv[1:])\n"
    "end = lambda: (os.read(0, 1), server.terminate())\n"
    "threading.Thread(target=end, daemon=True).start()\n"
    "server.wait()\n"
)
"""Program that runs a command until the command ends or stdin is closed, as it is when this process
ends for any reason.
"""
PROGRAM = str(Path(rerun_cli.__file__).parent / f"rerun{'.exe' * (sys.platform == 'win32')}")
"""Rerun's viewer and server: those of this rerun-sdk, not one on PATH."""


@final
class LiveViewer(Recording):
    """Rerun's server of one recording on 127.0.0.1, and a viewer that is connected to it: Rerun's
    window, or a page in a browser (`web`). `port` is the TCP port of the data, and the next one is
    that of the page. `recording` is a file to serve; None: what is logged is served.
    """

    def __init__(self, *, web: bool, port: int, recording: Path | None = None) -> None:
        """Start the server and the viewer.

        Args:
            web: Whether the viewer is a browser; its page is at the port after `port`.
            port: TCP port of the data.
            recording: A recording's file to serve; None: serve what is logged to this object.

        Raises:
            Mistake: A port is in use, or there is no display for a window.
            Refused: The server does not start.
        """
        if not web and not has_display():
            raise Mistake("there is no display here: use --live --web to watch in a browser")
        ports = [port, port + 1] if web else [port]
        for taken in filter(_listens, ports):
            raise Mistake(f"--port {port}: port {taken} is in use; choose another one with --port")
        self.source = f"rerun+http://{HOST}:{port}/proxy"
        self.page = f"http://{HOST}:{port + 1}/?url={quote(self.source, safe='')}" if web else None
        more = ["--serve-web", "--web-viewer-port", str(port + 1)] if web else ["--serve-grpc"]
        more += [] if recording is None else [str(recording)]
        self._server = _start_rerun(*more, "--bind", HOST, "--port", str(port))
        self._window = None
        self._wait_for(ports)
        if self.page is None:
            self._window = _start_rerun(self.source)
        elif has_display():
            webbrowser.open(self.page)

    def _wait_for(self, ports: list[int]) -> None:
        end = time.monotonic() + STARTS_WITHIN
        for port in ports:
            while not _listens(port):
                if time.monotonic() > end or self._server.poll() is not None:
                    self.stop()
                    raise Refused(
                        f"Rerun's server does not start at port {port}; choose another one with "
                        "--port"
                    )
                time.sleep(POLL)

    def begin(self, app: str, blueprint: rrb.Blueprint) -> rr.RecordingStream:
        """Return a new Rerun stream that sends its data to the server; `blueprint` is the layout of
        the viewer.
        """
        self._stream = new_stream(app, None)
        self._stream.connect_grpc(self.source, default_blueprint=blueprint)
        return self._stream

    def refusal(self) -> Refused:
        """Return the error that Rerun's server has ended, so that the viewer gets no more data."""
        return Refused("the viewer: Rerun's server has ended; run the command again")

    def wait(self) -> None:
        """Wait until the user closes the viewer's window; if the viewer is a browser, until Ctrl-C,
        which raises KeyboardInterrupt.

        Raises:
            Refused: Rerun's server has ended.
        """
        while self._window is None or self._window.poll() is None:
            if self._server.poll() is not None:
                raise self.refusal()
            time.sleep(POLL)

    def stop(self) -> None:
        """Close the viewer's window, if there is one, and end the server."""
        for process in filter(None, (self._window, self._server)):
            process.communicate()


def _start_rerun(*words: str) -> subprocess.Popen[bytes]:
    """Start Rerun's program with these arguments as a process that ends with this one."""
    return subprocess.Popen(
        [sys.executable, "-c", UNTIL_CLOSED, PROGRAM, *words],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,  # Ctrl-C is for us: the last pictures are still to be sent
    )


def _listens(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex((HOST, port)) == 0
