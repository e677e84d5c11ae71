"""Web pages that are served on 127.0.0.1, so that only this machine can open them."""

import secrets
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

HOST = "127.0.0.1"


class LocalServer(ThreadingHTTPServer):
    """HTTP server at 127.0.0.1 that answers each request in a thread of its own."""

    def __init__(self, port: int, handler: type[BaseHTTPRequestHandler], path: str = "/") -> None:
        """Listen at a port; requests are answered after `begin`.

        Args:
            port: TCP port; 0: any free one.
            handler: Class that answers requests.
            path: Path of the page in its address.

        Raises:
            OSError: The port is in use.
        """
        super().__init__((HOST, port), handler)
        self.path = path
        self.port: int = self.server_address[1]
        self.address = f"http://{HOST}:{self.port}{path}"

    def begin(self) -> None:
        """Answer requests in a background thread until `shutdown` is called."""
        threading.Thread(target=self.serve_forever, daemon=True).start()

    def handle_error(self, request: object, client_address: object) -> None:
        """Ignore an error of one connection, such as a browser that resets it."""


class LocalHandler(BaseHTTPRequestHandler):
    """Handler of requests that answers only those to a known path and with this server's name as
    Host, so that a page of another site gets no answer.
    """

    server: LocalServer  # pyright: ignore[reportIncompatibleVariableOverride]
    timeout = 10.0  # of a browser that neither sends nor reads

    def is_ours(self, path: str) -> bool:
        """Return whether the request is for this path of this server; if not, answer with 404."""
        hosts = {f"{HOST}:{self.server.port}", f"localhost:{self.server.port}"}
        right = secrets.compare_digest(self.path.encode(), path.encode())
        if not right or self.headers.get("Host") not in hosts:
            self.send(404, b"there is nothing here", {})
            return False
        return True

    def send(self, code: int, body: bytes, headers: dict[str, str]) -> None:
        """Answer with an HTTP status code, headers and a body."""
        self.send_response(code)
        for header, value in headers.items():
            self.send_header(header, value)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002  (its name there)
        """Print no line about the request, as the base class would."""
