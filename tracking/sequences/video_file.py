"""Video files: their pictures with their stamps, by FFmpeg (PyAV).

FFmpeg accepts a file by its content, and only as one of these formats: playlists and other texts
could make it open more files. It gets an open file without a name, so that it reads no addresses
and no numbered series.
"""

import gc
import math
import os
import re
from collections.abc import Generator, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
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
from sim.types import Image
from tracking.sequences.sources import SECOND, End, Picture, timed

SLOWEST = 0.01
FASTEST = 10_000.0
"""Accepted frames a second."""
GIVEN_UP = 100
"""Most frames in a row that cannot be decoded; after one more, the video ends."""
CYCLES = 50
"""Packets after which frames are freed whose side data was read: each is part of a cycle, and holds
its pixels, until Python looks for cycles."""
FORMATS = "mov,mp4,matroska,webm,avi,mpegts,mpeg,flv,ogg,asf,gif,yuv4mpegpipe"
"""FFmpeg's names of the accepted formats."""
MP4 = "mov,mp4,m4a,3gp,3g2,mj2"
"""FFmpeg's name of MP4 and its relatives."""
KNOWN = "MP4, MOV, Matroska, WebM, AVI, MPEG-TS, MPEG-PS, FLV, Ogg, ASF, GIF, Y4M"
QUARTER = 0.01
"""Largest ratio of the small and the large entries of a display matrix of quarter turns."""
COVER = Disposition.attached_pic
DEEP_FORMATS = re.compile(r"(?P<grey>gray16|ya16)|rgb48|bgr48|rgba64|bgra64|gbrp16|gbrap16")
"""Names of FFmpeg's formats of grey or RGB with 16 bits, without the order of the bytes."""
LENGTH = re.compile(r"(\d+):(\d+):(\d+\.?\d*)")
LAST_SHOWN = 1.0
"""Longest time that the last frame of a whole video is shown [s]."""
PACKETS = (188, 192, 204)
"""Lengths of the packets of MPEG-TS, of which a whole file has a whole number [bytes]."""
PAGE = 65_307
"""Longest page of Ogg [bytes]."""
PAGE_HEAD = 27
"""Length of a page's head, whose last byte is the number of lengths that follow [bytes]."""
LAST_PAGE = 4
"""Flag of the last page of a stream in Ogg."""
BOX_HEAD = 8
"""Length of a box's own length and name in MP4 [bytes]."""
NO_INDEX = "moov atom not found"
"""What FFmpeg prints where an MP4 has no index."""
PREMATURE = "File ended prematurely"
"""What FFmpeg prints, and does not return, where a Matroska file is cut."""


@dataclass(frozen=True, slots=True)
class Decoded:
    """One frame of a video, as it was decoded."""

    stamp: float | None
    """The time that the file states [s]."""
    image: Image | None
    """None if it cannot be decoded."""
    damaged: bool = False
    """True if FFmpeg has filled in parts of it."""
    notes: tuple[str, ...] = ()
    """As those of `Picture`."""


@dataclass(slots=True)
class Video:
    """A video file; its pictures have the times that it states."""

    path: Path
    rate: float
    count: int
    is_cut: bool = False
    """True if the end of the file is missing."""
    end: End | None = None

    @staticmethod
    def of(path: Path) -> "Video":
        """Open a video file for its rate and number of frames.

        Raises:
            ValueError: It cannot be read, or is not one video.
        """
        with reading.opened(path, "video") as file, printed_by_ffmpeg() as printed:
            try:
                with _container(file) as container:
                    video = _described(path, container, file)
                is_cut = any(PREMATURE in text for _, _, text in printed)
                return replace(video, is_cut=video.is_cut or is_cut)
            except FFmpegError:
                reason = f"this is not a video that can be read; known formats are {KNOWN}"
                file.seek(0)
                has_pictures = b"mdat" in file.read(PAGE)
                if has_pictures and any(NO_INDEX in text for _, _, text in printed):
                    reason = "the index of this MP4 is missing, as in a recording that was cut off"
            except OSError as error:
                reason = f"cannot read this video: {error.strerror}"
            except ValueError as error:
                reason = str(error)
        raise ValueError(f"{path}: {reason}")

    def __iter__(self) -> Iterator[Picture]:
        """Give all frames; those that are missing at the end of a truncated file have no image."""
        return timed(self._frames(), self.rate)

    def _frames(self) -> Iterator[tuple[float | None, Picture]]:
        """Give the stamp [s] of each frame, and the frame without its time."""
        index = failures = damaged = there = 0
        self.end = None
        with (
            reading.opened(self.path, "video") as file,
            _container(file) as container,
            suppress(FFmpegError, OSError),
            printed_by_ffmpeg(av.logging.ERROR) as printed,
        ):
            for frame in decoded(container.demux(only_video(container))):
                failures = failures + 1 if frame.image is None else 0
                if failures > GIVEN_UP:
                    break
                there += frame.image is not None
                damaged += frame.damaged or bool(printed)
                stamp = None if frame.stamp is None else round(frame.stamp * SECOND)
                name = f"frame {index}"
                yield frame.stamp, Picture(name, 0.0, frame.image, stamp=stamp, notes=frame.notes)
                printed.clear()  # also what a film that is written meanwhile has printed
                index += 1
        damaged += bool(printed)
        sentence = ""
        if self.is_cut:
            sentence = f"{there} pictures, then this video breaks off"
        elif index < self.count:
            sentence = f"{there} of {self.count} pictures can be decoded"
        elif damaged:
            sentence = f"{damaged} of {index} pictures are damaged"
        if sentence:
            self.end = End(f"{self.path}: {sentence}", lost=True, damaged=damaged)
        for missing in range(index, min(self.count, index + GIVEN_UP - failures)):
            yield None, Picture(f"frame {missing}", 0.0, None)


def _described(path: Path, container: InputContainer, file: BinaryIO) -> Video:
    stream = only_video(container)
    rate = float(stream.average_rate or stream.guessed_rate or 0)
    if not SLOWEST <= rate <= FASTEST:
        raise ValueError(
            f"this video states {rate:g} frames a second; accepted are {SLOWEST:g} to "
            f"{FASTEST:g}: convert it to a folder of pictures and give --rate"
        )
    count = stream.frames
    end = 0
    is_cut = False
    if not count:
        count, end, is_cut = _counted(container, stream)
    size = file.seek(0, os.SEEK_END)
    file.seek(-min(size, PAGE), os.SEEK_END)
    tail = file.read()
    is_whole = {
        "mpegts": not all(size % packet for packet in PACKETS),
        "gif": tail.endswith(b";"),
        "ogg": _is_last_page(tail[tail.rfind(b"OggS") :]),
        "yuv4mpegpipe": size == end,
        MP4: size == _end_of_boxes(file, size),
    }
    is_cut = is_cut or not is_whole.get(container.format.name, True)
    if stream.frames and container.format.name == MP4 and not is_cut:
        count = _shown(container, stream)
    return Video(path, rate, count, is_cut)


def _end_of_boxes(file: BinaryIO, size: int) -> int:
    """Return where the last box of an MP4 file ends by its own length [bytes]."""
    at = 0
    while at < size:
        file.seek(at)
        head = file.read(16)
        length = int.from_bytes(head[:4])
        if length == 1:  # a length of 64 bits follows
            length = int.from_bytes(head[8:])
        if length < BOX_HEAD:  # 0: up to the end of the file
            return size if len(head) >= BOX_HEAD else -1
        at += length
    return at


def _is_last_page(page: bytes) -> bool:
    """Return whether a page of Ogg is whole and the last one (RFC 3533)."""
    *_, count = page[:PAGE_HEAD]
    lengths = page[PAGE_HEAD : PAGE_HEAD + count]
    return len(page) == PAGE_HEAD + count + sum(lengths) and bool(page[5] & LAST_PAGE)


def decoded(packets: "Iterable[Packet[VideoStream]]") -> Iterator[Decoded]:
    """Decode the stamps and frames of the packets of an open file or stream.

    Raises:
        FFmpegError, OSError: It breaks off.
    """
    depth = BitDepth()
    reformatter = VideoReformatter()  # one of its own for each frame takes 300 kB
    for number, packet in enumerate(packets):
        if number % CYCLES == 0:
            gc.collect(0)
        try:
            frames = packet.decode()
        except (FFmpegError, OSError):
            yield Decoded(None, None)
            continue
        for frame in frames:
            image = _rgb(frame, depth, reformatter)
            notes = (*_turns(frame), *depth.notes)
            yield Decoded(frame.time, image, frame.is_corrupt, notes)


def _rgb(frame: av.VideoFrame, depth: BitDepth, reformatter: VideoReformatter) -> Image | None:
    """Return a frame as its file says that it is shown; None if it cannot be decoded."""
    try:
        check_size(frame.width, frame.height)
        pixels = _eight_bits(frame, depth, reformatter)
        image = _as_shown(pixels, _display_matrix(frame))
    except (ValueError, FFmpegError):
        return None
    image = np.ascontiguousarray(image, np.uint8)
    image.setflags(write=False)
    return image


def _eight_bits(frame: av.VideoFrame, depth: BitDepth, reformatter: VideoReformatter) -> Image:
    """Return a frame as RGB (H, W, 3), without the bits that its camera does not use.

    A format of 10 or 12 bits states which are used. So does YUV, whose black and white are fixed.
    """
    deep = DEEP_FORMATS.match(frame.format.name)
    if deep is not None and depth.used != DEEP:
        form = "gray16le" if deep["grey"] else "rgb48le"
        pixels = np.asarray(reformatter.reformat(frame, format=form).to_ndarray(), np.uint16)
        if not depth.uses_all(pixels):
            image = depth.reduced(pixels)
            return np.repeat(image[..., None], 3, axis=2) if deep["grey"] else image
    return np.asarray(reformatter.reformat(frame, format="rgb24").to_ndarray(), np.uint8)


def _display_matrix(frame: av.VideoFrame) -> tuple[int, int, int, int]:
    """Return (a, b, c, d), by which a frame is shown: a telephone writes it.

    It takes a pixel (x, y) to (a x + c y, b x + d y).
    """
    matrix = frame.side_data.get("DISPLAYMATRIX")
    if matrix is None:
        return 1, 0, 0, 1
    a, b, _, c, d, *_ = np.frombuffer(bytes(matrix), np.int32).tolist()
    return a, b, c, d


def _as_shown(image: Image, matrix: tuple[int, int, int, int]) -> Image:
    """Return an image turned by quarter turns and mirrored as a display matrix says."""
    a, b, c, d = matrix
    if abs(a) + abs(d) < abs(b) + abs(c):
        image = image.swapaxes(0, 1)
        a = c
        d = b
    return image[:: -1 if d < 0 else 1, :: -1 if a < 0 else 1]


def _turns(frame: av.VideoFrame) -> list[str]:
    """Return a sentence about a display matrix that is not of quarter turns, if there is one."""
    a, b, c, d = _display_matrix(frame)
    straight, crossed = abs(a) + abs(d), abs(b) + abs(c)
    if min(straight, crossed) <= QUARTER * max(straight, crossed):
        return []
    angle = math.degrees(math.atan2(b, a))  # y goes down
    sense = "clockwise" if angle > 0 else "counterclockwise"
    return [
        f"this video says that it is shown turned by {abs(angle):.0f} degrees {sense}; its "
        "pictures are turned to the nearest quarter turn only"
    ]


@contextmanager
def printed_by_ffmpeg(lowest: int = av.logging.WARNING) -> Generator[list[tuple[int, str, str]]]:
    """Collect what FFmpeg prints from a level on, and does not return: level, name, text."""
    level = av.logging.get_level()
    skips = av.logging.get_skip_repeated()
    av.logging.set_level(lowest)
    av.logging.set_skip_repeated(False)
    try:
        with av.logging.Capture(local=False) as printed:
            yield printed
    finally:
        av.logging.set_level(level)
        av.logging.set_skip_repeated(skips)


class _Nameless:
    """An open file without its name, which FFmpeg would use to detect the format."""

    def __init__(self, file: BinaryIO) -> None:
        self.read = file.read
        self.seek = file.seek
        self.tell = file.tell


def _container(file: BinaryIO) -> InputContainer:
    options = {"format_whitelist": FORMATS, "protocol_whitelist": "pipe"}
    return av.open(_Nameless(file), mode="r", options=options)


def only_video(container: InputContainer) -> VideoStream:
    """Return the only video stream, without album covers.

    Raises:
        ValueError: There is none or are several, or its pictures have no size or a huge one.
    """
    streams = [s for s in container.streams.video if not s.disposition & COVER]
    if len(streams) != 1:
        there = "there are no pictures" if not streams else f"there are {len(streams)} videos"
        raise ValueError(f"{there} in this file; give a file with one video")
    stream = streams[0]
    if getattr(stream, "codec_context", None) is None:  # FFmpeg has no decoder of this kind
        raise ValueError("the pictures of this video are compressed in a way that is not known")
    if not stream.width or not stream.height:
        raise ValueError("no frame of this video can be decoded")
    check_size(stream.width, stream.height, "first frame: the picture")
    return stream


def _shown(container: InputContainer, stream: VideoStream) -> int:
    """Return the number of frames that an MP4 shows: one that was trimmed without encoding has an
    edit list, and keeps frames that only others need.
    """
    index = getattr(stream, "index_entries", None)  # PyAV before 16 has none
    frames = (p for p in container.demux(stream) if p.size) if index is None else index
    return sum(not frame.is_discard for frame in frames)


def _counted(container: InputContainer, stream: VideoStream) -> tuple[int, int, bool]:
    """Return the number of frames of a file that states none, where the last one ends, and whether
    it is cut.
    """
    count = end = 0
    last = 0.0
    is_cut = False
    with suppress(FFmpegError, OSError):
        for packet in container.demux(stream):
            if packet.size > 0:
                count += 1
                end = (packet.pos or 0) + packet.size
                last = max(last, float((packet.pts or 0) * (stream.time_base or 0)))
                is_cut = packet.is_corrupt
    return count, end, is_cut or last < _stated(container, stream)


def _stated(container: InputContainer, stream: VideoStream) -> float:
    """Return the time after which a frame must come in a whole file [s], by its stream's length.

    Matroska, WebM and FLV may state it; 0 where it is not known.
    """
    found = LENGTH.fullmatch(stream.metadata.get("DURATION", ""))
    if found is None:
        length = container.duration if container.format.name == "flv" else None
        return (length or 0) / av.time_base - LAST_SHOWN
    hours, minutes, seconds = map(float, found.groups())
    return 3600 * hours + 60 * minutes + seconds - LAST_SHOWN
