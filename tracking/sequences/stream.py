"""Cameras of this machine (camera:0), and streams by their address (rtsp, http, tcp, udp)."""

import re
import time
from collections.abc import Generator, Iterator
from contextlib import contextmanager

import av
import cv2
from av.container import InputContainer
from av.error import ExitError, FFmpegError

from sim.files.picture_file import rgb
from sim.quiet import silent_libraries
from sim.types import Image
from tracking.sequences.live_source import Feed, LiveSource, SourceLost
from tracking.sequences.sources import RATE
from tracking.sequences.video_file import (
    FASTEST,
    FORMATS,
    SLOWEST,
    Stamped,
    decoded,
    only_video,
)

ADDRESS = re.compile(r"(rtsps?|https?|tcp|udp)://", re.IGNORECASE)
PASSWORD = re.compile(r"(?<=//)([^/@:]*):[^/@]*@")
PROTOCOLS = {
    "rtsp": "rtp,udp,tcp",
    "rtsps": "rtp,udp,tcp,tls",
    "http": "http,tcp",
    "https": "https,http,tls,tcp",
    "tcp": "tcp",
    "udp": "udp",
}
"""Protocols that FFmpeg may open for an address: never a file of this machine."""
STREAMS = f"{FORMATS},rtsp,rtp,mpjpeg,mjpeg,jpeg_pipe,h264,hevc"
"""Formats that FFmpeg may detect: no playlists, which name other addresses and files."""
PATIENCE = 5.0
"""Longest time without an answer or a picture [s]."""
OPTIONS = {"rtsp_flags": "prefer_tcp", "analyzeduration": "1000000"}
"""No "nobuffer": it throws away what was read to detect the format, and so the first key frame and
all pictures up to the next one."""


def shown(address: str) -> str:
    """Return an address without its password, to print and to store.

    >>> shown("rtsp://eye:secret@10.0.0.7/one")
    'rtsp://eye:***@10.0.0.7/one'
    """
    return PASSWORD.sub(r"\1:***@", address)


def stream(address: str) -> LiveSource:
    """Return the stream at an address that `ADDRESS` matches."""
    return LiveSource(shown(address), lambda: _stream(address))


def camera(number: int) -> LiveSource:
    """Return a camera of this machine."""
    return LiveSource(f"camera:{number}", lambda: _camera(number))


@contextmanager
def _stream(address: str) -> Generator[Feed]:
    scheme = address.partition(":")[0].lower()
    options = OPTIONS | {"format_whitelist": STREAMS, "protocol_whitelist": PROTOCOLS[scheme]}
    began = time.monotonic()
    try:
        container = av.open(address, options=options, timeout=PATIENCE)
    except (FFmpegError, OSError, ValueError) as error:
        late = time.monotonic() > began + PATIENCE  # RTSP then says that the data are invalid
        raise SourceLost(
            f"cannot open this stream: {_silent() if late else _reason(error)}"
        ) from None
    with container:
        try:
            video = only_video(container)
        except ValueError as error:
            raise SourceLost(str(error)) from None
        rate = float(video.average_rate or video.guessed_rate or 0)
        recording = scheme.startswith("http") and container.duration is not None
        rate = rate if SLOWEST <= rate <= FASTEST else RATE
        yield Feed(_pictures(container, video), rate, waits=recording)


def _pictures(container: InputContainer, video: av.VideoStream) -> Iterator[Stamped]:
    try:
        yield from decoded(container, video)
    except (FFmpegError, OSError) as error:
        raise SourceLost(_reason(error)) from None


def _reason(error: Exception) -> str:
    if isinstance(error, ExitError):
        return _silent()
    return getattr(error, "strerror", None) or str(error)


def _silent() -> str:
    return f"nothing came for {PATIENCE:g} s"


@contextmanager
def _camera(number: int) -> Generator[Feed]:
    with silent_libraries():
        capture = cv2.VideoCapture(number)
    try:
        if not capture.isOpened():
            raise SourceLost("there is no such camera")
        yield Feed(_captured(capture))
    finally:
        capture.release()


def _captured(capture: cv2.VideoCapture) -> Iterator[tuple[float, Image]]:
    while True:
        more, image = capture.read()
        if not more:
            raise SourceLost("it gives no more pictures")
        yield time.monotonic(), rgb(image)
