"""Pages that are served on 127.0.0.1, to this machine alone."""

import secrets
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

HOST = "127.0.0.1"


class LocalServer(ThreadingHTTPServer):
    """Serves from threads of its own, from its first call of `begin` on."""

    def __init__(self, port: int, handler: type[BaseHTTPRequestHandler], path: str = "/") -> None:
        """Listen at a port, or at any for 0; the page is at `path`.

        Raises:
            OSError: The port is in use.
        """
        super().__init__((HOST, port), handler)
        self.path = path
        self.port: int = self.server_address[1]
        self.address = f"http://{HOST}:{self.port}{path}"

    def begin(self) -> None:
        """Serve until `shutdown`."""
        threading.Thread(target=self.serve_forever, daemon=True).start()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Go on: a client that resets its connection is no failure of the page."""


class LocalHandler(BaseHTTPRequestHandler):
    """Answers those who know the address, and no page of another site that guesses it."""

    server: LocalServer  # pyright: ignore[reportIncompatibleVariableOverride]
    timeout = 10.0  # of a browser that neither sends nor reads

    def is_ours(self, path: str) -> bool:
        """Return whether this path is asked for; otherwise, answer that there is nothing."""
        hosts = {f"{HOST}:{self.server.port}", f"localhost:{self.server.port}"}
        right = secrets.compare_digest(self.path.encode(), path.encode())
        if not right or self.headers.get("Host") not in hosts:
            self.send(404, b"there is nothing here", {})
            return False
        return True

    def send(self, code: int, body: bytes, headers: dict[str, str]) -> None:
        """Send a whole answer."""
        self.send_response(code)
        for header, value in headers.items():
            self.send_header(header, value)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: Any) -> None:  # noqa: A002  (its name there)
        """Print nothing."""
