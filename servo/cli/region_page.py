"""A page on 127.0.0.1 on which a person draws a region, for machines without a desktop.

Its address holds a random token, so that other users of the machine cannot answer, and no other
page in the browser. The server ends with the first answer.
"""

from __future__ import annotations

import base64
import json
import math
import secrets
import threading
import time
import webbrowser
from collections.abc import Callable
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib import resources
from queue import Empty, Queue
from typing import Any

from jinja2 import Environment, StrictUndefined

from servo.mistake import Mistake
from servo.output.display import has_display
from sim.types import Image
from tracking.drawing.picture_bytes import encoded

Box = tuple[float, float, float, float, float]
"""Left, top, width, height [px], and rotation about the centre [deg]."""
HOST = "127.0.0.1"
PATIENCE = 600.0
"""Time to wait for an answer [s]."""
GRACE = 2.0
"""Time after the page was closed in which it may be loaded again [s]."""
QUALITY = 92
"""JPEG quality of the picture."""
LONGEST = 1000
"""Longest answer [bytes]."""
NUMBERS = 5
HEADERS = {
    "Content-Type": "text/html; charset=utf-8",
    "Cache-Control": "no-store",
    "Referrer-Policy": "no-referrer",
    "X-Frame-Options": "DENY",
    "Content-Security-Policy": "default-src 'none'; img-src data:; style-src 'unsafe-inline'; "
    "script-src 'unsafe-inline'; connect-src 'self'",
}
OPENED = "opened"
CLOSED = "closed"
CANCELLED = "cancelled"


def ask(image: Image, name: str, say: Callable[[str], None]) -> Box | None:
    """Serve the page until it is answered, and open it in a browser where there is a desktop.

    Args:
        image: The picture, RGB (H, W, 3).
        name: The source's name, for the title.
        say: Prints the address.

    Returns:
        The region; None if the person cancelled or closed the page.

    Raises:
        Mistake: There was no answer in time.
    """
    with _Server(_page(image, name)) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        address = f"http://{HOST}:{server.port}{server.path}"
        say(
            f"draw the region on this page: {address}\n"
            f"  (of another machine: first ssh -L {server.port}:{HOST}:{server.port} THIS-MACHINE)"
        )
        if has_display():
            webbrowser.open(address)
        try:
            return _answer(server.answers, address)
        finally:
            server.shutdown()


def _answer(answers: Queue[Any], address: str) -> Box | None:
    end = time.monotonic() + PATIENCE
    closed = False
    while True:
        left = GRACE if closed else max(end - time.monotonic(), 0.0)
        try:
            found = answers.get(timeout=left)
        except Empty:
            if closed:
                return None
            raise Mistake(
                f"--select: nobody drew a region on {address} within {PATIENCE:g} s; "
                "give --region X,Y,W,H[,DEG]"
            ) from None
        closed = found == CLOSED
        if found == CANCELLED:
            return None
        if isinstance(found, tuple):
            return found


def _page(image: Image, name: str) -> bytes:
    template = (resources.files("servo.cli") / "templates" / "region.html.jinja").read_text("utf-8")
    picture = base64.b64encode(encoded(image, QUALITY)).decode()
    page = Environment(undefined=StrictUndefined, autoescape=True).from_string(template)
    height, width = image.shape[:2]
    return page.render(name=name, width=width, height=height, picture=picture).encode(
        errors="replace"
    )


class _Server(ThreadingHTTPServer):
    """Serves one page at an address that nobody can guess."""

    def __init__(self, page: bytes) -> None:
        super().__init__((HOST, 0), _Handler)
        self.page = page
        self.path = f"/{secrets.token_urlsafe(16)}"
        self.port = self.server_address[1]
        self.answers: Queue[Any] = Queue()


class _Handler(BaseHTTPRequestHandler):
    """Sends the page, and takes its answer."""

    server: _Server  # pyright: ignore[reportIncompatibleVariableOverride]
    timeout = 10.0  # of a browser that sends nothing

    def do_GET(self) -> None:
        if self._is_ours():
            self.server.answers.put(OPENED)
            self._send(200, self.server.page)

    def do_POST(self) -> None:
        if not self._is_ours():
            return
        try:
            length = min(int(self.headers.get("Content-Length", "0")), LONGEST)
            found = json.loads(self.rfile.read(length))
            if found not in (CLOSED, CANCELLED):
                found = tuple(float(number) for number in found)
                if len(found) != NUMBERS or not all(map(math.isfinite, found)):
                    raise ValueError(found)
        except (ValueError, TypeError, RecursionError):
            self._send(400, b"this is not a region")
            return
        self._send(200, b"")
        self.server.answers.put(found)

    def _is_ours(self) -> bool:
        """Return whether the address is right; otherwise, answer that nothing is there."""
        hosts = {f"{HOST}:{self.server.port}", f"localhost:{self.server.port}"}
        right = secrets.compare_digest(self.path.encode(), self.server.path.encode())
        if not right or self.headers.get("Host") not in hosts:
            self._send(404, b"there is nothing here")
            return False
        return True

    def _send(self, code: int, body: bytes) -> None:
        self.send_response(code)
        for header, value in HEADERS.items():
            self.send_header(header, value)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: Any) -> None:  # noqa: A002  (its name there)
        """Print nothing."""
