"""A local web page that shows the film of a run or a track while it goes on, as MJPEG pictures.

The browser needs no GPU, unlike for Rerun's viewer.
"""

import threading
import webbrowser
from collections.abc import Iterator
from typing import final

from servo.mistake import Mistake
from servo.output.local_page import LocalHandler, LocalServer, has_display
from servo.output.sinks import Sink, Timer
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
"""Sent right after each picture: browsers show a picture when they see that it is complete."""
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
    """Receiver of the frames of a film that keeps the newest one as JPEG. Any number of threads may
    read it; a slow reader skips frames.
    """

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._jpeg: bytes | None = b""
        """The newest frame; empty before the first one, None at the end."""

    def add(self, image: Image, time: float) -> None:
        """Store an RGB picture (H, W, 3) as the newest frame, and wake up all readers; `time` is
        not used.
        """
        self._store(encoded(image, QUALITY))

    def close(self) -> None:
        """Do nothing: readers keep the last frame until `end` is called."""

    abandon = close

    def end(self) -> None:
        """End the iterators of all readers."""
        self._store(None)

    def _store(self, jpeg: bytes | None) -> None:
        with self._changed:
            self._jpeg = jpeg
            self._changed.notify_all()

    def read(self) -> Iterator[bytes]:
        """Yield the newest frame as the bytes of a JPEG file, whenever there is one that this
        reader has not seen; end after a call of `end`. A slow reader skips frames.
        """
        jpeg: bytes | None = b""
        while True:
            with self._changed:
                self._changed.wait_for(lambda seen=jpeg: self._jpeg is not seen)
                jpeg = self._jpeg
            if jpeg is None:
                return
            yield jpeg


@final
class LightPage:
    """Web server, at a TCP port of 127.0.0.1, of a page that shows a film as it goes on: each frame
    that is added to its attribute `pictures` appears on the page. The page is opened in a browser
    if there is a display.
    """

    def __init__(self, port: int) -> None:
        """Start to serve at a port of 127.0.0.1; open the page if there is a display.

        Raises:
            Mistake: The port is in use.
        """
        self.pictures = NewestPicture()
        answers = {
            "GET /": lambda request: request.send(200, PAGE.encode(), HEADERS),
            f"GET {PICTURES}": self._send_pictures,
        }
        try:
            self._server = LocalServer(port, answers)
        except OSError:
            raise Mistake(
                f"--port {port}: port {port} is in use; choose another one with --port"
            ) from None
        self.page = self._server.address
        if has_display():
            webbrowser.open(self.page)

    def wait(self) -> None:
        """Wait, with the page still served, until Ctrl-C, which raises KeyboardInterrupt."""
        threading.Event().wait()

    def stop(self) -> None:
        """End all streams of pictures, and stop serving the page."""
        self.pictures.end()
        self._server.shutdown()
        self._server.server_close()

    def _send_pictures(self, request: LocalHandler) -> None:
        """Answer with a stream of pictures, which lasts until the run ends."""
        request.send_response(200)
        request.send_header("Content-Type", STREAM)
        request.send_header("Cache-Control", "no-store")
        request.end_headers()
        request.wfile.write(BETWEEN)
        for jpeg in self.pictures.read():
            head = f"Content-Type: image/jpeg\r\nContent-Length: {len(jpeg)}\r\n\r\n"
            request.wfile.write(head.encode() + jpeg + b"\r\n" + BETWEEN)


class ThrottledSink:
    """A sink (receiver of the frames of a run or a track) that passes on at most ten frames a
    second of the wall clock to another sink, and drops the others.
    """

    def __init__(self, sink: Sink) -> None:
        self._sink = sink
        self._timer = Timer(EVERY)
        self.close = sink.close
        self.abandon = sink.abandon

    def add(self, *given: object) -> None:
        """Pass a frame on to the other sink if 0.1 s have passed since the last one that was passed
        on (before the first, since this object was made); else drop it.
        """
        if self._timer.due():
            self._sink.add(*given)
