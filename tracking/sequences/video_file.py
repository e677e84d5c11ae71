"""Video files: a check of their format, and their pictures with their stamps, by FFmpeg (PyAV).

A file is accepted by its first bytes and by the format that FFmpeg detects, not by its name:
playlists and other texts could make FFmpeg open more files, and logs of robots are not videos.
FFmpeg gets an open file without its name, so that it reads no addresses and no numbered series.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import av
import numpy as np
from av.container import InputContainer
from av.error import FFmpegError
from av.stream import Disposition
from av.video.stream import VideoStream

from sim.files import reading
from sim.files.picture_file import check_size
from sim.types import Image
from tracking.sequences.sources import End, Picture, Times

SLOWEST = 0.01
FASTEST = 10_000.0
"""Accepted frames a second."""
GIVEN_UP = 100
"""Most frames in a row that cannot be decoded; after one more, the video ends."""
FORMATS = "mov,mp4,matroska,webm,avi,mpegts,mpeg,flv,ogg,asf,gif,yuv4mpegpipe"
"""FFmpeg's names of the accepted formats."""
KNOWN = "MP4, MOV, Matroska, WebM, AVI, MPEG-TS, MPEG-PS, FLV, Ogg, ASF, GIF, Y4M"
BEGINNINGS = (
    *((4, box) for box in (b"ftyp", b"moov", b"mdat", b"free", b"skip", b"wide", b"pnot")),
    (0, b"\x1aE\xdf\xa3"),
    (8, b"AVI "),
    (0, b"\0\0\1\xba"),
    (0, b"FLV\1"),
    (0, b"OggS"),
    (0, b"0&\xb2u\x8ef\xcf\x11"),
    (0, b"GIF8"),
    (0, b"YUV4MPEG2 "),
    (0, b"G"),
    (4, b"G"),
)
"""First bytes of the accepted formats, with their offset; FFmpeg checks MPEG-TS (G) further."""
OTHERS = {
    b"RRF2": "this is a Rerun recording, not a video: convert the pictures of one camera to a "
    "video or a folder of pictures",
    b"\xff\xd8\xff": "this is one picture, not a video: put the pictures in a folder and give that",
    b"\x89PNG": "this is one picture, not a video: put the pictures in a folder and give that",
    b"\0\0\0\1": "this is a bare stream without times, not a video: put it in an MP4 or Matroska",
    b"\0\0\1": "this is a bare stream without times, not a video: put it in an MP4 or Matroska",
}
COVER = Disposition.attached_pic
LENGTH = re.compile(r"(\d+):(\d+):(\d+\.?\d*)")
LAST_SHOWN = 1.0
"""Longest time that the last frame of a whole video is shown [s]."""
HEAD = 64
"""Length of the beginning that is checked [bytes]."""
Stamped = tuple[float | None, Image | None]
"""The time that a file states for a frame [s], if any; and the frame, if it can be decoded."""


@dataclass(frozen=True, slots=True)
class Video:
    """A video file; its pictures have the times that it states."""

    path: Path
    rate: float
    count: int
    end: End | None = None

    @staticmethod
    def of(path: Path) -> Video:
        """A video file that can be read.

        Raises:
            ValueError: It is not a video of a known format.
        """
        return Video(path, *describe(path))

    def __iter__(self) -> Iterator[Picture]:
        times = Times(self.rate)
        for index, (stamp, image) in enumerate(images(self.path, self.count)):
            yield Picture(f"frame {index}", times.since_first(stamp), image)


def check_beginning(head: bytes) -> None:
    """Refuse a file whose first bytes are not those of a video.

    Raises:
        ValueError: The file is empty, or its first bytes are not those of a video.
    """
    if not head:
        raise ValueError("this is an empty file")
    if any(head.startswith(begin, at) for at, begin in BEGINNINGS):
        return
    for begin, sentence in OTHERS.items():
        if head.startswith(begin):
            raise ValueError(sentence)
    if all(byte >= 32 or byte in b"\t\r\n" for byte in head):
        raise ValueError("this is a text, such as a playlist, not a video: give the video itself")
    raise ValueError(f"this is not a video; known formats are {KNOWN}")


def describe(path: Path) -> tuple[float, int, End | None]:
    """Frames a second, how many frames there are, and whether the file breaks off.

    Raises:
        ValueError: The file cannot be read, or is not one video.
    """
    with reading.opened(path, "video") as file:
        try:
            check_beginning(file.read(HEAD))
            with _container(file) as container:
                stream = only_video(container)
                rate = float(stream.average_rate or stream.guessed_rate or 0)
                if not SLOWEST <= rate <= FASTEST:
                    raise ValueError(
                        f"this video states {rate:g} frames a second; accepted are {SLOWEST:g} to "
                        f"{FASTEST:g}: convert it to a folder of pictures and give --rate"
                    )
                if stream.frames:
                    return rate, stream.frames, None
                count, last = _counted(container, stream)
                end = f"{path}: {count} pictures, then this video breaks off"
                return rate, count, End(end, lost=True) if last < _stated(stream) else None
        except FFmpegError:
            raise ValueError(f"{path}: this video is damaged, or not of a known format") from None
        except OSError as error:
            reason = f"cannot read this video: {error.strerror}"
            raise ValueError(f"{path}: {reason}") from None
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from None


def images(path: Path, count: int) -> Iterator[Stamped]:
    """The frames as RGB (H, W, 3), read-only, with their stamps.

    Args:
        path: A video that `describe` accepts.
        count: Its number of frames; the missing frames of a truncated video are None.

    Raises:
        ValueError: The file cannot be read.
    """
    given = failures = 0
    with (
        reading.opened(path, "video") as file,
        _container(file) as container,
        suppress(FFmpegError, OSError),
    ):
        for stamp, found in decoded(container, only_video(container)):
            failures = failures + 1 if found is None else 0
            if failures > GIVEN_UP:
                return
            given += 1
            yield stamp, found
    yield from itertools.repeat((None, None), min(max(count - given, 0), GIVEN_UP - failures))


def decoded(container: InputContainer, stream: VideoStream) -> Iterator[Stamped]:
    """Stamps and frames of an open file or stream.

    Raises:
        FFmpegError, OSError: It breaks off.
    """
    for packet in container.demux(stream):
        try:
            frames = packet.decode()
        except (FFmpegError, OSError):
            yield None, None
            continue
        yield from ((frame.time, _rgb(frame)) for frame in frames)


def _rgb(frame: av.VideoFrame) -> Image | None:
    """A frame with the rotation that its file states; None if it cannot be decoded."""
    try:
        check_size(frame.width, frame.height)
        image = np.rot90(frame.to_ndarray(format="rgb24"), round(frame.rotation / 90))
    except (ValueError, FFmpegError):
        return None
    image = np.ascontiguousarray(image, np.uint8)
    image.setflags(write=False)
    return image


class _Nameless:
    """An open file without its name, which FFmpeg would use to detect the format."""

    def __init__(self, file: BinaryIO) -> None:
        self.read = file.read
        self.seek = file.seek
        self.tell = file.tell


def _container(file: BinaryIO) -> InputContainer:
    file.seek(0)
    options = {"format_whitelist": FORMATS, "protocol_whitelist": "pipe"}
    return av.open(_Nameless(file), mode="r", options=options)


def only_video(container: InputContainer) -> VideoStream:
    """The only video stream, without album covers.

    Raises:
        ValueError: There is none or are several, or its pictures have no size or a huge one.
    """
    streams = [s for s in container.streams.video if not s.disposition & COVER]
    if len(streams) != 1:
        there = "there are no pictures" if not streams else f"there are {len(streams)} videos"
        raise ValueError(f"{there} in this file; give a file with one video")
    stream = streams[0]
    if not stream.width or not stream.height:
        raise ValueError("no frame of this video can be decoded")
    check_size(stream.width, stream.height, "first frame: the picture")
    return stream


def _counted(container: InputContainer, stream: VideoStream) -> tuple[int, float]:
    """Number of frames and the last one's stamp [s], of a file that does not state the number."""
    count = 0
    last = 0.0
    with suppress(FFmpegError, OSError):
        for packet in container.demux(stream):
            if packet.size > 0:
                count += 1
                last = max(last, float((packet.pts or 0) * (stream.time_base or 0)))
    return count, last


def _stated(stream: VideoStream) -> float:
    """The time after which a frame must come in a whole file [s], by its stream's length.

    Matroska and WebM may state it; 0 where it is not known.
    """
    found = LENGTH.fullmatch(stream.metadata.get("DURATION", ""))
    if found is None:
        return 0.0
    hours, minutes, seconds = map(float, found.groups())
    return 3600 * hours + 60 * minutes + seconds - LAST_SHOWN
