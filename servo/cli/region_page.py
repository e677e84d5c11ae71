"""A page on 127.0.0.1 on which a person draws a region, for machines without a desktop.

Its address holds a random token, so that other users of the machine cannot answer, and no other
page in the browser. The server ends with the first answer.
"""

import base64
import itertools
import secrets
import threading
import webbrowser
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib import resources
from queue import Empty, Queue
from typing import Any, Literal

import pydantic
from jinja2 import Environment, StrictUndefined
from rich.console import Console

from servo.cli.terminal import plain
from servo.mistake import Mistake
from servo.output.display import has_display
from sim.types import Image
from tracking.drawing.picture_bytes import encoded
from tracking.sequences.sources import Picture

Number = pydantic.FiniteFloat
Box = tuple[Number, Number, Number, Number, Number]
"""Left, top, width, height [px], and rotation about the centre [deg]."""
HOST = "127.0.0.1"
PATIENCE = 600.0
"""Time to wait for an answer [s]."""
QUALITY = 92
"""JPEG quality of the picture."""
LONGEST = 1000
"""Longest answer [bytes]."""
HEADERS = {
    "Content-Type": "text/html; charset=utf-8",
    "Cache-Control": "no-store",
    "Referrer-Policy": "no-referrer",
    "X-Frame-Options": "DENY",
    "Content-Security-Policy": "default-src 'none'; img-src data:; style-src 'unsafe-inline'; "
    "script-src 'unsafe-inline'; connect-src 'self'",
}
DIGITS = 6
"""Digits of a region's numbers."""
CANCELLED = "cancelled"
"""The answer of a person who draws no region."""
ANSWER = pydantic.TypeAdapter[Box | Literal["cancelled"]](Box | Literal["cancelled"])


def select(
    source: str, pictures: Iterator[Picture], region: str | None
) -> tuple[str, Iterator[Picture]]:
    """Let a person draw the region in the first picture.

    Returns:
        The region as a text for `region_of`, and all pictures.

    Raises:
        Mistake: There is a region already, the first picture cannot be read, or none was drawn.
        ValueError: The source cannot be read.
    """
    if region is not None:
        raise Mistake("give --region or --select, not both")
    first = next(pictures, None)
    if first is None:
        raise Mistake(f"{source}: there are no pictures in it")
    if first.image is None:
        raise Mistake(f"{first.name}: the first picture cannot be read: {first.reason}")
    box = ask(first.image, source)
    if box is None:
        raise Mistake("--select was cancelled; give --region X,Y,W,H[,DEG]")
    text = ",".join(f"{number:.{DIGITS}g}" for number in (box if box[4] else box[:4]))
    _say(f"--region {text} repeats this choice")
    return text, itertools.chain([first], pictures)


def _say(text: str) -> None:
    plain(Console(stderr=True), text)


def ask(image: Image, name: str) -> Box | None:
    """Serve the page until it is answered, and open it in a browser where there is a desktop.

    Args:
        image: The picture, RGB (H, W, 3).
        name: The source's name, for the title.

    Returns:
        The region; None if the person cancelled.

    Raises:
        Mistake: There was no answer in time.
    """
    with _Server(_page(image, name)) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        address = f"http://{HOST}:{server.port}{server.path}"
        _say(
            f"draw the region on this page: {address}\n"
            f"  (of another machine: first ssh -L {server.port}:{HOST}:{server.port} THIS-MACHINE)"
        )
        if has_display():
            webbrowser.open(address)
        try:
            return server.answers.get(timeout=PATIENCE)
        except Empty:
            raise Mistake(
                f"--select: nobody drew a region on {address} within {PATIENCE:g} s; "
                "give --region X,Y,W,H[,DEG]"
            ) from None
        finally:
            server.shutdown()


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
        self.answers: Queue[Box | None] = Queue()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Go on: a client that resets its connection is no failure of the page."""


class _Handler(BaseHTTPRequestHandler):
    """Sends the page, and takes its answer."""

    server: _Server  # pyright: ignore[reportIncompatibleVariableOverride]
    timeout = 10.0  # of a browser that sends nothing

    def do_GET(self) -> None:
        if self._is_ours():
            self._send(200, self.server.page)

    def do_POST(self) -> None:
        if not self._is_ours():
            return
        try:
            length = min(int(self.headers.get("Content-Length", "0")), LONGEST)
            found = ANSWER.validate_json(self.rfile.read(length), strict=True)
        except ValueError:
            self._send(400, b"this is not a region")
            return
        self._send(200, b"")
        self.server.answers.put(None if found == CANCELLED else found)

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
