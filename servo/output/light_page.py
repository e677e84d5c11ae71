"""A page that shows a run or a track while it goes on, picture by picture (MJPEG).

A browser needs no GPU for it, as it does for Rerun's viewer. What it shows is the film.
"""

import threading
import webbrowser
from collections.abc import Iterator
from typing import Any, final

from servo.mistake import Mistake
from servo.output.display import has_display
from servo.output.local_page import LocalHandler, LocalServer
from servo.output.sinks import Every, Sink
from sim.types import Image
from tracking.drawing.picture_bytes import encoded

EVERY = 0.1
"""Least time between two pictures: to draw one takes about half of it [s]."""
QUALITY = 80
"""JPEG quality of the pictures."""
PICTURES = "/pictures"
BOUNDARY = "picture"
STREAM = f"multipart/x-mixed-replace; boundary={BOUNDARY}"
BETWEEN = f"--{BOUNDARY}\r\n".encode()
"""Is sent right after each picture: browsers show one when they see that it is complete."""
PAGE = f"""<!DOCTYPE html>
<html lang="en">
<meta charset="utf-8">
<meta name="viewport" content="width=device-width">
<title>servobench</title>
<style>
  body {{ margin: 0; height: 100dvh; background: #fff; }}
  img {{ display: block; width: 100%; height: 100%; object-fit: contain; }}
</style>
<img src="{PICTURES}" alt="the run as it goes on: camera, room and errors">
"""
HEADERS = {"Content-Type": "text/html; charset=utf-8", "Cache-Control": "no-store"}


class NewestPicture:
    """The newest picture of a film, for any number of readers; slow ones miss some."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._number = 0
        self._jpeg = b""
        self._ended = False

    def add(self, image: Image, time: float) -> None:
        """Take a picture (H, W, 3); its time in the film does not count here."""
        jpeg = encoded(image, QUALITY)
        with self._changed:
            self._number += 1
            self._jpeg = jpeg
            self._changed.notify_all()

    def close(self) -> None:
        """Take no more; readers keep the last one."""

    abandon = close

    def end(self) -> None:
        """Let the readers go."""
        with self._changed:
            self._ended = True
            self._changed.notify_all()

    def read(self) -> Iterator[bytes]:
        """Yield the newest JPEG file, and each time there is a newer one, that, until `end`."""
        seen = 0
        while True:
            with self._changed:
                while not self._ended and self._number == seen:
                    self._changed.wait()
                if self._ended:
                    return
                seen = self._number
                jpeg = self._jpeg
            yield jpeg


@final
class LightPage:
    """The page, and the server of its pictures."""

    def __init__(self, port: int) -> None:
        """Serve the page, which shows what comes into `pictures`.

        Raises:
            Mistake: The port is in use.
        """
        try:
            self._server = _Server(port, _Handler)
        except OSError:
            raise Mistake(
                f"--port {port}: port {port} is in use; choose another one with --port"
            ) from None
        self.pictures = self._server.pictures
        self.page = self._server.address
        self._server.begin()
        if has_display():
            webbrowser.open(self.page)

    def wait(self) -> None:
        """Serve until Ctrl-C."""
        threading.Event().wait()

    def stop(self) -> None:
        """Stop serving."""
        self.pictures.end()
        self._server.shutdown()
        self._server.server_close()


class NowAndThen:
    """A sink that takes only as many frames as a page can show."""

    def __init__(self, sink: Sink) -> None:
        self._sink = sink
        self._every = Every(EVERY)
        self.close = sink.close
        self.abandon = sink.abandon

    def add(self, *given: Any) -> None:
        """Pass a frame on, if the last one is long enough ago."""
        if self._every.due():
            self._sink.add(*given)


class _Server(LocalServer):
    def __init__(self, port: int, handler: type[LocalHandler]) -> None:
        super().__init__(port, handler)
        self.pictures = NewestPicture()


class _Handler(LocalHandler):
    """Sends the page, or its pictures for as long as they come."""

    server: _Server  # pyright: ignore[reportIncompatibleVariableOverride]

    def do_GET(self) -> None:
        if self.path != PICTURES:
            if self.is_ours(self.server.path):
                self.send(200, PAGE.encode(), HEADERS)
        elif self.is_ours(PICTURES):
            self._send_pictures()

    def _send_pictures(self) -> None:
        self.send_response(200)
        self.send_header("Content-Type", STREAM)
        self.send_header("Cache-Control", "no-store")
        self.end_headers()
        self.wfile.write(BETWEEN)
        for jpeg in self.server.pictures.read():
            head = f"Content-Type: image/jpeg\r\nContent-Length: {len(jpeg)}\r\n\r\n"
            self.wfile.write(head.encode() + jpeg + b"\r\n" + BETWEEN)
