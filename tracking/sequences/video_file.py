"""Video files: their pictures with the time stamps that the files state, read by FFmpeg (PyAV).

FFmpeg detects the format by a file's content, and only among `FORMATS`: playlists and other texts
could make it open more files. It gets an open file without a name, so that it reads no addresses
and no numbered series.

Damage is known only from FFmpeg: errors that it returns, frames that it marks, and errors that it
prints. Of some cut files, such as MPEG-TS or Ogg, FFmpeg reports no damage.
"""

import re
from collections.abc import Generator, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import BinaryIO

import av
import av.logging
import numpy as np
from av.container import InputContainer
from av.error import FFmpegError
from av.packet import Packet
from av.stream import Disposition
from av.video.reformatter import VideoReformatter
from av.video.stream import VideoStream

from sim.files import reading
from sim.files.bit_depth import DEEP, BitDepth
from sim.files.picture_file import check_size
from sim.types import Array, Image
from tracking.sequences.sources import SECOND, End, Picture, timed

SLOWEST = 0.01
"""Least accepted rate [frames/s]."""
FASTEST = 10_000.0
"""Largest accepted rate [frames/s]."""
MOST_MISSING = 100
"""Largest number of frames without an image that are yielded for frames that a file states and does
not have."""
FORMATS = "mov,mp4,matroska,webm,avi,mpegts,mpeg,flv,ogg,asf,gif,yuv4mpegpipe"
"""FFmpeg's names of the accepted formats."""
KNOWN = "MP4, MOV, Matroska, WebM, AVI, MPEG-TS, MPEG-PS, FLV, Ogg, ASF, GIF, Y4M"
"""The accepted formats, for messages."""
DEEP_FORMATS = re.compile(r"(?P<grey>gray16|ya16)|rgb48|bgr48|rgba64|bgra64|gbrp16|gbrap16")
"""Names of FFmpeg's pixel formats of grey or RGB with 16 bits, without the order of the bytes."""
Matrix = tuple[int, int, int, int]
"""(a, b, c, d) of a display matrix: a pixel (x, y) is shown at (a x + c y, b x + d y)."""
UNTURNED: Matrix = (1, 0, 0, 1)
"""The display matrix of a frame that is shown as it is stored."""


@dataclass(slots=True)
class Video:
    """Source of the pictures of a video file, with their rate [1/s], the number of frames, and a
    report on missing or damaged pictures of the last reading (None: all were read).
    """

    path: Path
    rate: float
    """Rate of the pictures [1/s]."""
    count: int
    """Number of frames that the file states or, if it states none, contains."""
    end: End | None = None
    """Report on missing or damaged pictures of the last reading; None: all were read."""

    @staticmethod
    def of(path: Path) -> "Video":
        """Return the source of a video file, which is read for its rate and number of frames.

        Raises:
            ValueError: The file cannot be read, does not hold exactly one video that can be
                decoded, or states no rate from 0.01 to 10,000 frames/s.
        """
        with reading.opened(path, "video") as file, printed_by_ffmpeg() as printed:
            try:
                with _container(file) as container:
                    stream = only_video(container)
                    return Video(path, _rate(stream), _count(container, stream))
            except FFmpegError:
                of_format = [each for each in printed if "whitelist" not in each[2]]
                reason = (
                    f"this is not a video that can be read{quoted(of_format)}; "
                    f"known formats are {KNOWN}"
                )
            except OSError as error:
                reason = f"cannot read this video: {error.strerror}"
            except ValueError as error:
                reason = str(error)
        raise ValueError(f"{path}: {reason}")

    def times(self) -> Array:
        """Return the times (n,) [s] of the n frames since the first one, in the order in which they
        are shown, by the time stamps in the file and without decoding; evenly spaced if stamps are
        missing.

        Raises:
            ValueError: The file cannot be read.
        """
        with reading.opened(self.path, "video") as file, _container(file) as container:
            stream = only_video(container)
            demuxed = container.demux(stream)
            packets = [p.pts for p in demuxed if p.size and not p.is_discard]
            unit = float(stream.time_base or 0)
        stamps = np.array([pts for pts in packets if pts is not None], float)
        if unit == 0 or len(stamps) < len(packets):
            return np.arange(len(packets)) / self.rate
        return (np.sort(stamps) - stamps.min(initial=np.inf)) * unit

    def __iter__(self) -> Iterator[Picture]:
        """Yield all frames; those that are missing at the end of a cut file, at most 100, have no
        image.
        """
        return timed(self._frames(), self.rate)

    def _frames(self) -> Iterator[Picture]:
        """Yield all frames, all with time 0 (their stamps give the times later), and set `end` to
        the report on the reading.
        """
        index = readable = damaged = 0
        report = ""
        self.end = None
        try:
            with (
                reading.opened(self.path, "video") as file,
                _container(file) as container,
                printed_by_ffmpeg() as printed,
            ):
                for frame in decoded(container.demux(only_video(container))):
                    readable += frame.image is not None
                    damaged += frame.damaged or bool(printed)
                    report = report or quoted(printed)
                    yield replace(frame, name=f"frame {index}")
                    printed.clear()  # also messages of a film that is written meanwhile
                    index += 1
                damaged += bool(printed)
                report = report or quoted(printed)
        except (FFmpegError, OSError) as error:
            damaged += 1
            report = report or f" ({error.strerror})"
        sentence = f"{damaged} of {index} pictures are damaged{report}" if damaged else ""
        if index < self.count:
            sentence = f"{readable} of {self.count} pictures can be decoded{report}"
        if sentence:
            self.end = End(f"{self.path}: {sentence}", lost=True, damaged=damaged)
        for missing in range(index, min(self.count, index + MOST_MISSING)):
            yield Picture(f"frame {missing}", 0.0, None)


def decoded(packets: "Iterable[Packet[VideoStream]]") -> Iterator[Picture]:
    """Yield the pictures in packets of an open file or stream, without names and with time 0; the
    image is None where a picture cannot be decoded.

    Raises:
        FFmpegError, OSError: The file or stream breaks off.
    """
    depth = BitDepth()
    reformatter = VideoReformatter()  # a new one for each frame would take 300 kB
    matrix: Matrix | None = None
    for packet in packets:
        try:
            frames = packet.decode()
        except (FFmpegError, OSError):
            yield Picture("", 0.0, None)
            continue
        for frame in frames:
            # Only once: reading side data makes a cycle of objects that keeps the frame's pixels.
            matrix = matrix or _display_matrix(frame)
            image = _rgb(frame, matrix, depth, reformatter)
            stamp = None if frame.pts is None else round(frame.time * SECOND)
            yield Picture("", 0.0, image, stamp=stamp, notes=depth.notes, damaged=frame.is_corrupt)


def _rgb(
    frame: av.VideoFrame, matrix: Matrix, depth: BitDepth, reformatter: VideoReformatter
) -> Image | None:
    """Return a frame as RGB (H, W, 3), read-only, turned and mirrored by a display matrix; None if
    the frame cannot be decoded or is too large.
    """
    try:
        check_size(frame.width, frame.height)
        pixels = _eight_bits(frame, depth, reformatter)
    except (ValueError, FFmpegError):
        return None
    image = np.ascontiguousarray(_as_shown(pixels, matrix), np.uint8)
    image.setflags(write=False)
    return image


def _eight_bits(frame: av.VideoFrame, depth: BitDepth, reformatter: VideoReformatter) -> Image:
    """Return a frame as RGB (H, W, 3) of 8 bits.

    Of 16 bits, the highest 8 that the camera uses are taken. FFmpeg itself converts formats of 10
    or 12 bits, which state the bits in use, and YUV, whose black and white are fixed.
    """
    deep = DEEP_FORMATS.match(frame.format.name)
    if deep is not None and depth.used != DEEP:
        form = "gray16le" if deep["grey"] else "rgb48le"
        pixels = np.asarray(reformatter.reformat(frame, format=form).to_ndarray(), np.uint16)
        if not depth.uses_all(pixels):
            image = depth.reduced(pixels)
            return np.repeat(image[..., None], 3, axis=2) if deep["grey"] else image
    return np.asarray(reformatter.reformat(frame, format="rgb24").to_ndarray(), np.uint8)


def _display_matrix(frame: av.VideoFrame) -> Matrix:
    """Return the display matrix of a frame, with which telephones say how a video is turned;
    without one, the matrix of an unturned picture.
    """
    matrix = frame.side_data.get("DISPLAYMATRIX")
    if matrix is None:
        return UNTURNED
    a, b, _, c, d, *_ = np.frombuffer(bytes(matrix), np.int32).tolist()
    return a, b, c, d


def _as_shown(image: Image, matrix: Matrix) -> Image:
    """Return an image (H, W, 3) turned by the nearest quarter turn of a display matrix, and
    mirrored by it.
    """
    a, b, c, d = matrix
    if abs(a) + abs(d) < abs(b) + abs(c):
        image = image.swapaxes(0, 1)
        a = c
        d = b
    return image[:: -1 if d < 0 else 1, :: -1 if a < 0 else 1]


Printed = list[tuple[int, str, str]]
"""Messages of FFmpeg: level, name of the part that prints, text."""


@contextmanager
def printed_by_ffmpeg() -> Generator[Printed]:
    """Context manager: collect the errors that FFmpeg prints during the block. Its value is a list
    of (level, name of the part of FFmpeg, text), which grows as they come.
    """
    level = av.logging.get_level()
    skips = av.logging.get_skip_repeated()
    av.logging.set_level(av.logging.ERROR)
    av.logging.set_skip_repeated(False)  # each damaged frame counts
    try:
        with av.logging.Capture(local=False) as printed:
            yield printed
    finally:
        av.logging.set_level(level)
        av.logging.set_skip_repeated(skips)


def quoted(printed: Printed) -> str:
    """Return the first of FFmpeg's messages in brackets, with a space before them, to end a
    sentence; "" for an empty list.
    """
    return f" (FFmpeg: {' '.join(printed[0][2].split()).rstrip('.')})" if printed else ""


def _container(file: BinaryIO) -> InputContainer:
    """Open a video file with FFmpeg, which finds its format by the content, among `FORMATS`
    only.
    """
    # Without the file's name, by which FFmpeg would guess the format.
    nameless = SimpleNamespace(read=file.read, seek=file.seek, tell=file.tell)
    options = {"format_whitelist": FORMATS, "protocol_whitelist": "pipe"}
    return av.open(nameless, mode="r", options=options)


def only_video(container: InputContainer) -> VideoStream:
    """Return the only video stream of an open file or stream; album covers do not count.

    Raises:
        ValueError: There is no video stream or several, or the pictures cannot be decoded, have no
            size, or are too large.
    """
    streams = [s for s in container.streams.video if not s.disposition & Disposition.attached_pic]
    if len(streams) != 1:
        count = len(streams) or "no"
        raise ValueError(f"there are {count} videos in this source; give one with a single video")
    stream = streams[0]
    if getattr(stream, "codec_context", None) is None:  # FFmpeg has no decoder of this kind
        raise ValueError(
            "FFmpeg here has no decoder for the compression of this video: convert it to H.264"
        )
    if not stream.width or not stream.height:
        raise ValueError("no frame of this video can be decoded: give another source")
    check_size(stream.width, stream.height, "first frame: the picture")
    return stream


def rate_of(stream: VideoStream) -> float:
    """Return the rate that a stream states or that FFmpeg guesses [frames/s]; 0: not known."""
    return float(stream.average_rate or stream.guessed_rate or 0)


def _rate(stream: VideoStream) -> float:
    """Return the rate of a video file [frames/s].

    Raises:
        ValueError: The rate is not known, or out of range.
    """
    rate = rate_of(stream)
    if not SLOWEST <= rate <= FASTEST:
        stated = f"{rate:g} frames a second" if rate else "no rate"
        raise ValueError(
            f"this video states {stated}; accepted are {SLOWEST:g} to "
            f"{FASTEST:g} frames a second: convert it to a folder of pictures and give their rate "
            "(--rate, or recording.rate in a scenario)"
        )
    return rate


def _count(container: InputContainer, stream: VideoStream) -> int:
    """Return the number of frames that a file states or, if it states none, contains."""
    if stream.frames and "mp4" in container.format.name:
        # A file that was trimmed without new encoding keeps hidden frames that others refer to.
        shown = [not e.is_discard for e in getattr(stream, "index_entries", ())]  # from PyAV 16 on
        return sum(shown) or stream.frames
    if stream.frames:
        return stream.frames
    count = 0
    with suppress(FFmpegError, OSError):
        for packet in container.demux(stream):
            count += packet.size > 0
    return count
