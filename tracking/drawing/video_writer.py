"""Writing of MP4 files in H.264 that browsers play, each frame shown at its own time.

While a file is written, each frame is a fragment of its own, so that the film can be played even if
the program is killed. When the file is closed, it becomes an ordinary MP4 file.
"""

import io
import os
from collections.abc import Generator
from contextlib import contextmanager, suppress
from fractions import Fraction
from pathlib import Path

import av
from av.error import FFmpegError
from av.video.reformatter import ColorRange, Colorspace

from sim.types import Image
from tracking.files import atomic

CODEC = "libx264"
FORMAT = "yuv420p"
OPTIONS = {"preset": "veryfast", "tune": "zerolatency", "crf": "18", "g": "30"}
"""Options of the encoder: it encodes each frame at once, thin lines stay sharp, and every 30th
frame is a key frame, from which a player can start."""
FRAGMENTED = {
    "movflags": "hybrid_fragmented+frag_every_frame+empty_moov+default_base_moof",
    "flush_packets": "1",
}
TICKS = 90_000
"""Resolution of the frames' times [1/s]."""
BT709 = 1
"""H.264's number of the primaries and the transfer function of the standard BT.709."""


class VideoWriter:
    """Writes RGB frames (height, width, 3) to an MP4 file (H.264), each shown from its own time [s]
    on; sides are even numbers [px], and `rate` is the approximate rate of the frames [1/s].
    """

    def __init__(self, path: Path, rate: float, width: int, height: int) -> None:
        """Open the MP4 file for writing; an older file of this name is replaced.

        Args:
            path: The file.
            rate: Approximate rate of the frames [1/s].
            width: Width of the frames [px], an even number.
            height: Height of the frames [px], an even number.

        Raises:
            OSError: The file cannot be written.
        """
        self._path = path
        # FFmpeg gets an open file, because it accepts only names in UTF-8.
        self._file = _WholeFile(path, "w")
        self._container = av.open(self._file, mode="w", format="mp4", options=FRAGMENTED)
        about = Fraction(rate).limit_denominator(TICKS)
        stream = self._stream = self._container.add_stream(
            CODEC,
            rate=about,
            options=OPTIONS,
            width=width,
            height=height,
            pix_fmt=FORMAT,
            colorspace=Colorspace.ITU709,
            color_range=ColorRange.MPEG,
            color_primaries=BT709,
            color_trc=BT709,
        )
        stream.time_base = stream.codec_context.time_base = Fraction(1, TICKS)
        self._period = round(TICKS / rate)
        self._last = -1
        self._head = 0
        self._whole = 0
        """Size of the file's head, and of the file up to its last whole fragment [bytes]."""

    def add(self, image: Image, time: float) -> None:
        """Write a frame, RGB (height, width, 3), that is shown from `time` [s] until that of the
        next one.

        Raises:
            OSError: The file cannot be written; it is closed, and keeps the frames that it has
                whole.
        """
        ticks = max(round(TICKS * time), self._last + 1)
        frame = av.VideoFrame.from_ndarray(image, format="rgb24").reformat(
            format=FORMAT, dst_colorspace=Colorspace.ITU709
        )
        frame.pts = ticks
        frame.time_base = Fraction(1, TICKS)
        frame.duration = self._period
        self._last = ticks
        with self._abandoned_if_refused():
            self._container.mux(self._stream.encode(frame))
        self._whole = self._file.tell()
        self._head = self._head or self._whole

    def close(self) -> None:
        """Finish the file; a file without frames is removed. A second call does nothing.

        Raises:
            OSError: The file cannot be written; it is closed, and keeps the frames that it has
                whole.
        """
        if self._last < 0:
            self.abandon()
        if self._file.closed:
            return
        with self._abandoned_if_refused():
            self._container.mux(self._stream.encode(None))
            self._container.close()
        self._file.close()

    def abandon(self) -> None:
        """Close the file after an error; it keeps the frames that it has whole, and is removed if
        it has none.
        """
        if self._file.closed:
            return
        # FFmpeg still writes an end; PyAV 15 crashes where it cannot, some time later.
        with Path(os.devnull).open("wb") as nowhere:
            os.dup2(nowhere.fileno(), self._file.fileno())
        with self._file, suppress(OSError, FFmpegError):  # the caller has the first error
            self._container.close()
        if self._whole > self._head:
            os.truncate(self._path, self._whole)
        else:
            self._path.unlink(missing_ok=True)

    @contextmanager
    def _abandoned_if_refused(self) -> Generator[None]:
        """Context manager: on an OSError of the block, add the file's name to the error if it has
        none, and close the file, which keeps the frames that it has whole.
        """
        try:
            with atomic.naming(self._path):
                yield
        except OSError:
            self.abandon()
            raise


class _WholeFile(io.FileIO):
    """An unbuffered file whose `write` writes all bytes or raises an OSError.

    On a full disk the system writes a part of the bytes only, which PyAV does not notice.
    """

    def write(self, content: bytes) -> int:  # pyright: ignore[reportIncompatibleMethodOverride]
        rest = content
        while rest:
            rest = rest[super().write(rest) :]
        return len(content)
