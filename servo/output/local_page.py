"""Web pages that are served on 127.0.0.1, so that only this machine can open them, and whether
there is a display to show them on.
"""

import os
import sys
import threading
from collections.abc import Callable, Mapping
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

HOST = "127.0.0.1"
DISPLAYS = ("DISPLAY", "WAYLAND_DISPLAY")
"""Environment variables that name a display on Linux."""


def has_display() -> bool:
    """Return whether windows can be opened: on Linux, whether DISPLAY or WAYLAND_DISPLAY is set; on
    macOS and Windows always.
    """
    return sys.platform != "linux" or any(map(os.environ.get, DISPLAYS))


class LocalServer(ThreadingHTTPServer):
    """HTTP server at 127.0.0.1 that answers each request in a thread of its own. `answers` has a
    function for each allowed request, by method and path, such as "GET /"; `address` is the URL of
    the page.
    """

    def __init__(self, port: int, answers: Mapping[str, "Answer"], path: str = "/") -> None:
        """Listen at a port, and answer requests in a background thread until `shutdown`.

        Args:
            port: TCP port; 0: any free one.
            answers: Functions that answer the allowed requests, by method and path ("GET /").
            path: Path of the page in its address.

        Raises:
            OSError: The port is in use, or may not be used.
        """
        super().__init__((HOST, port), LocalHandler)
        self.answers = answers
        self.port: int = self.server_address[1]
        self.address = f"http://{HOST}:{self.port}{path}"
        threading.Thread(target=self.serve_forever, daemon=True).start()

    def handle_error(self, request: object, client_address: object) -> None:
        """Ignore an error in one connection, such as a browser that resets it, which the base class
        would print.
        """


class LocalHandler(BaseHTTPRequestHandler):
    """Handler of a request to a `LocalServer`. It answers only the requests that its server allows,
    and only if their Host is 127.0.0.1 or localhost with the server's port: otherwise another site
    could read answers by letting its own name lead to 127.0.0.1.
    """

    server: LocalServer  # pyright: ignore[reportIncompatibleVariableOverride]
    timeout = 10.0  # of a browser that neither sends nor reads

    def do_GET(self) -> None:
        """Answer a GET or POST request by the server's function for it; send 404 if the server has
        none or the Host is another one.
        """
        answer = self.server.answers.get(f"{self.command} {self.path}")
        hosts = (f"{HOST}:{self.server.port}", f"localhost:{self.server.port}")
        if answer is None or self.headers.get("Host") not in hosts:
            self.send(404, b"there is nothing here", {})
        else:
            answer(self)

    do_POST = do_GET

    def send(self, code: int, body: bytes, headers: Mapping[str, str]) -> None:
        """Send a whole answer: an HTTP status code, such as 200, headers by name, and a body; the
        length of the body is added to the headers.
        """
        self.send_response(code)
        for header, value in headers.items():
            self.send_header(header, value)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002  (its name there)
        """Do nothing: the base class would print a line about each request."""


Answer = Callable[[LocalHandler], None]
"""Function that answers a request, given the request's handler."""
