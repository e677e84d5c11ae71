"""Live sources: cameras of this machine (camera:0), and streams by address (rtsp, http, tcp, udp).

A thread reads the source into a queue for one picture. A new picture replaces the one in the queue,
so that a slow tracker gets the newest picture; replaced pictures are counted as dropped. Only the
reader of a recording on a web server waits for the tracker instead.
"""

import re
import threading
import time
from collections.abc import Callable, Generator, Iterator
from contextlib import AbstractContextManager, closing, contextmanager, suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from queue import Empty, Full, Queue

import av
import cv2
from av.container import InputContainer
from av.error import ExitError, FFmpegError
from av.video.stream import VideoStream

from sim.files.picture_file import rgb
from sim.stderr import silent_libraries
from tracking.sequences.sources import RATE, End, Picture, Times
from tracking.sequences.video_file import (
    FASTEST,
    FORMATS,
    SLOWEST,
    decoded,
    only_video,
    printed_by_ffmpeg,
    rate_of,
)

ADDRESS = re.compile(r"(rtsps?|https?|tcp|udp)://", re.IGNORECASE)
PASSWORD = re.compile(r"^(\w+://[^/@:]*):.*@", re.DOTALL)
"""An address up to the end of its password, the last @: passwords may contain any character."""
PROTOCOLS = {
    "rtsp": "rtp,udp,tcp",
    "rtsps": "rtp,udp,tcp,tls",
    "http": "http,tcp",
    "https": "https,http,tls,tcp",
    "tcp": "tcp",
    "udp": "udp",
}
"""Protocols that FFmpeg may open for an address, by its scheme: never a file of this machine."""
STREAMS = f"{FORMATS},rtsp,rtp,mpjpeg,mjpeg,jpeg_pipe,h264,hevc"
"""Formats that FFmpeg may detect; without playlists, which name other addresses and files."""
PATIENCE = 5.0
"""Longest time without an answer or a picture [s]."""
OPTIONS = {"rtsp_flags": "prefer_tcp", "analyzeduration": "1000000", "fpsprobesize": "2"}
"""Options of FFmpeg. It finds the rate by two pictures; by default it reads 20, which then come at
once, so that most are dropped. The option "nobuffer" is not used: it discards the pictures that
were read to detect the format, and without the first key frame all up to the next one are lost."""
UNSTAMPED = ("mpjpeg", "mjpeg", "jpeg_pipe", "h264", "hevc")
"""Formats without stamps: the time of a picture is that of its arrival."""
WAKE = 0.1
"""Time after which the waiting thread checks whether its pictures are still wanted [s]."""


class SourceLost(Exception):
    """Error: a camera or stream cannot be opened, or broke off; its text is the reason."""


@dataclass(frozen=True, slots=True)
class Feed:
    """An open camera or stream: its pictures, without names and times, their approximate rate
    [1/s], and whether the reader waits for the tracker instead of dropping pictures, as for a
    recording on a server.
    """

    pictures: Iterator[Picture]
    """Pictures without names and times; the iteration raises SourceLost where the source breaks
    off."""
    rate: float = RATE
    """Approximate rate of the pictures [1/s]."""
    waits: bool = False
    """True for a recording on a server: the reader waits for the tracker, and drops no picture."""


class LiveSource:
    """Source of the pictures of a camera or stream, which can be read only once. An iteration opens
    it by `opened` in a thread, yields the newest picture each time, and raises ValueError if there
    is none. `name` begins messages.
    """

    count: int | None = None

    def __init__(self, name: str, opened: Callable[[], AbstractContextManager[Feed]]) -> None:
        """Create the source; the camera or stream is opened when its pictures are iterated.

        Args:
            name: Name of the source in messages.
            opened: Function that opens the camera or stream for a `with` block; it raises
                SourceLost if it cannot.
        """
        self.name = name
        self.rate = RATE
        self._opened = opened
        self._queue: Queue[Picture | None] = Queue(maxsize=1)  # None: there are no more
        self._stop = threading.Event()
        self._given = self._dropped = self._damaged = self._failed = 0
        self._over = False
        self._broken = ""

    @property
    def end(self) -> End | None:
        """Report on the pictures so far: how the source ended, and how many pictures were dropped
        or damaged; None while the source is open and no picture was dropped or damaged.
        """
        counts = {
            "of them were dropped, because they came too fast": self._dropped,
            "of them are damaged": self._damaged,
            "more cannot be decoded": self._failed,
        }
        parts = [f"{count} {what}" for what, count in counts.items() if count]
        many = f"{self.name}: {self._given + self._dropped} pictures"
        then = ", then it ended" if self._over else ""
        if self._broken:
            then = f", then it was lost: {self._broken}"
        if not (then or parts):
            return None
        damaged = self._damaged + self._failed
        sentence = "; ".join([many + then, *parts])
        return End(sentence, bool(self._broken or damaged), self._dropped, damaged)

    def __iter__(self) -> Iterator[Picture]:
        reader = threading.Thread(target=self._read, daemon=True)
        reader.start()
        try:
            times = None
            while (picture := self._queue.get()) is not None:
                times = times or Times(self.rate)
                self._given += 1
                yield replace(picture, time=times.since_first(picture.stamp), stamp=None)
            if not self._given:
                reason = self._broken or "there are no pictures in it: check what it sends"
                raise ValueError(f"{self.name}: {reason}")
            self._over = True
        finally:
            self._stop.set()
            reader.join(WAKE)  # a thread that waits for a camera ends later

    def _read(self) -> None:
        """Read the source into the queue, until it ends or `_stop` is set."""
        index = 0
        try:
            with self._opened() as feed:
                self.rate = feed.rate
                for picture in feed.pictures:
                    if picture.image is not None:
                        self._damaged += picture.damaged
                        named = replace(picture, name=f"frame {index}", came=datetime.now(UTC))
                        self._put(named, wait=feed.waits)
                        index += 1
                    elif index:  # before the first picture are parts of one that was sent earlier
                        self._failed += 1
                    if self._stop.is_set():
                        return
        except SourceLost as error:
            self._broken = str(error)
        finally:
            self._put(None, wait=True)

    def _put(self, picture: Picture | None, *, wait: bool) -> None:
        """Put a picture into the queue: after waiting for room, or in place of the one there."""
        while not self._stop.is_set():
            with suppress(Full):
                return self._queue.put(picture, timeout=WAKE if wait else 0.0)
            if not wait:
                with suppress(Empty):
                    self._queue.get_nowait()
                    self._dropped += 1
        return None


def shown(address: str) -> str:
    """Return an address whose password is replaced by ***, to print and to store.

    >>> shown("rtsp://eye:secret@10.0.0.7/one")
    'rtsp://eye:***@10.0.0.7/one'
    >>> shown("rtsp://eye:p@ss/word@10.0.0.7/one")
    'rtsp://eye:***@10.0.0.7/one'
    """
    return PASSWORD.sub(r"\1:***@", address)


def stream(address: str) -> LiveSource:
    """Return the source of the pictures of a stream by its address, such as "rtsp://HOST/PATH"; the
    stream is opened when they are iterated.
    """
    return LiveSource(shown(address), lambda: _stream(address))


def camera(number: int) -> LiveSource:
    """Return the source of the pictures of a camera of this machine by its number, from 0 on; the
    camera is opened when they are iterated.
    """
    return LiveSource(f"camera:{number}", lambda: _camera(number))


@contextmanager
def _stream(address: str) -> Generator[Feed]:
    """Open a stream for the block.

    Raises:
        SourceLost: The stream cannot be opened, or does not hold exactly one video that can be
            decoded.
    """
    scheme, _, place = address.partition(":")
    scheme = scheme.lower()
    options = OPTIONS | {"format_whitelist": STREAMS, "protocol_whitelist": PROTOCOLS[scheme]}
    began = time.monotonic()
    try:
        container = av.open(f"{scheme}:{place}", options=options, timeout=PATIENCE)
    except (FFmpegError, OSError, ValueError) as error:
        # For an address without an answer, RTSP reports invalid data instead of the timeout.
        reason = _reason(error, late=time.monotonic() > began + PATIENCE)
        raise SourceLost(f"cannot open this stream: {reason}") from None
    with container:
        try:
            video = only_video(container)
        except ValueError as error:
            raise SourceLost(str(error)) from None
        rate = rate_of(video)
        recording = scheme.startswith("http") and container.duration is not None
        rate = rate if SLOWEST <= rate <= FASTEST else RATE
        with closing(_pictures(container, video)) as pictures:
            yield Feed(pictures, rate, waits=recording)


def _pictures(container: InputContainer, video: VideoStream) -> Generator[Picture]:
    """Yield the pictures of an open stream as they come, without names and times.

    Raises:
        SourceLost: The stream breaks off.
    """
    is_stamped = container.format.name not in UNSTAMPED
    printers = {video.codec_context.name, container.format.name}  # not those of a film meanwhile
    began = False
    try:
        with printed_by_ffmpeg() as printed:
            for picture in decoded(container.demux(video)):
                damaged = picture.damaged or any(name in printers for _, name, _ in printed)
                printed.clear()
                stamp = picture.stamp if is_stamped else time.monotonic_ns()
                # What was printed before the first picture is of one whose beginning was missed.
                yield replace(picture, stamp=stamp, damaged=began and damaged)
                began = began or picture.image is not None
    except (FFmpegError, OSError) as error:
        raise SourceLost(_reason(error)) from None


def _reason(error: Exception, *, late: bool = False) -> str:
    """Return the reason of an error of FFmpeg for a message; `late`: it came after `PATIENCE`."""
    if late or isinstance(error, ExitError):
        return f"nothing came for {PATIENCE:g} s"
    return getattr(error, "strerror", None) or str(error)


@contextmanager
def _camera(number: int) -> Generator[Feed]:
    """Open a camera for the block.

    Raises:
        SourceLost: There is no such camera, or it cannot be opened.
    """
    with silent_libraries():
        capture = cv2.VideoCapture(number)
    try:
        if not capture.isOpened():
            raise SourceLost(
                "there is no such camera, or it cannot be opened: check its number and its cable, "
                "and that no other program uses it"
            )
        yield Feed(_captured(capture))
    finally:
        capture.release()


def _captured(capture: cv2.VideoCapture) -> Iterator[Picture]:
    """Yield the pictures of an open camera until it is lost, with the times of their arrival.

    Raises:
        SourceLost: The camera sends no picture, or no more of them.
    """
    while True:
        more, image = capture.read()
        if not more:
            raise SourceLost(
                "no picture came from the camera: check its cable, and that no other program uses "
                "it"
            )
        yield Picture("", 0.0, rgb(image), stamp=time.monotonic_ns())
