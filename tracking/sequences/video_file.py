"""Video files: their pictures with their stamps, by FFmpeg (PyAV).

FFmpeg accepts a file by its content, and only as one of these formats: playlists and other texts
could make it open more files. It gets an open file without a name, so that it reads no addresses
and no numbered series.
"""

from __future__ import annotations

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
COVER = Disposition.attached_pic
LENGTH = re.compile(r"(\d+):(\d+):(\d+\.?\d*)")
LAST_SHOWN = 1.0
"""Longest time that the last frame of a whole video is shown [s]."""
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
        """Open a video file for its rate and number of frames.

        Raises:
            ValueError: It cannot be read, or is not one video.
        """
        with reading.opened(path, "video") as file:
            try:
                with _container(file) as container:
                    return _described(path, container)
            except FFmpegError:
                reason = f"this is not a video that can be read; known formats are {KNOWN}"
            except OSError as error:
                reason = f"cannot read this video: {error.strerror}"
            except ValueError as error:
                reason = str(error)
        raise ValueError(f"{path}: {reason}")

    def __iter__(self) -> Iterator[Picture]:
        """Give all frames; those that are missing at the end of a truncated file have no image."""
        times = Times(self.rate)
        index = failures = 0
        with (
            reading.opened(self.path, "video") as file,
            _container(file) as container,
            suppress(FFmpegError, OSError),
        ):
            for stamp, image in decoded(container, only_video(container)):
                failures = failures + 1 if image is None else 0
                if failures > GIVEN_UP:
                    return
                yield Picture(f"frame {index}", times.since_first(stamp), image)
                index += 1
        for missing in range(index, min(self.count, index + GIVEN_UP - failures)):
            yield Picture(f"frame {missing}", times.since_first(None), None)


def _described(path: Path, container: InputContainer) -> Video:
    stream = only_video(container)
    rate = float(stream.average_rate or stream.guessed_rate or 0)
    if not SLOWEST <= rate <= FASTEST:
        raise ValueError(
            f"this video states {rate:g} frames a second; accepted are {SLOWEST:g} to "
            f"{FASTEST:g}: convert it to a folder of pictures and give --rate"
        )
    if stream.frames:
        return Video(path, rate, stream.frames)
    count, last = _counted(container, stream)
    if last >= _stated(stream):
        return Video(path, rate, count)
    end = End(f"{path}: {count} pictures, then this video breaks off", lost=True)
    return Video(path, rate, count, end)


def decoded(container: InputContainer, stream: VideoStream) -> Iterator[Stamped]:
    """Decode the stamps and frames of an open file or stream.

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
    """Return a frame with the rotation that its file states; None if it cannot be decoded."""
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
    if not stream.width or not stream.height:
        raise ValueError("no frame of this video can be decoded")
    check_size(stream.width, stream.height, "first frame: the picture")
    return stream


def _counted(container: InputContainer, stream: VideoStream) -> tuple[int, float]:
    """Return the number of frames and the last one's stamp [s] of a file that states no number."""
    count = 0
    last = 0.0
    with suppress(FFmpegError, OSError):
        for packet in container.demux(stream):
            if packet.size > 0:
                count += 1
                last = max(last, float((packet.pts or 0) * (stream.time_base or 0)))
    return count, last


def _stated(stream: VideoStream) -> float:
    """Return the time after which a frame must come in a whole file [s], by its stream's length.

    Matroska and WebM may state it; 0 where it is not known.
    """
    found = LENGTH.fullmatch(stream.metadata.get("DURATION", ""))
    if found is None:
        return 0.0
    hours, minutes, seconds = map(float, found.groups())
    return 3600 * hours + 60 * minutes + seconds - LAST_SHOWN
