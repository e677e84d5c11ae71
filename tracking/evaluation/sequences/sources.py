"""Sources of pictures: a folder of images, a video file, a live camera, a painting function."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import cv2

from sim.files import reading
from sim.files.picture_file import SUFFIXES, read_image, rgb
from sim.quiet import silent_libraries
from sim.types import Image
from tracking.evaluation.sequences import video_file

RATE = 30.0
"""Default rate of folders and cameras [pictures a second]."""


@dataclass(frozen=True, slots=True)
class Picture:
    """One picture of a source, or the reason why it cannot be read."""

    name: str
    """File name, or "frame 12"."""
    time: float
    """Time since the first picture [s]."""
    image: Image | None
    """RGB (H, W, 3), read-only; None if it cannot be decoded."""
    reason: str = "it cannot be decoded"
    """Why there is no image, if there is none."""


class Source(Protocol):
    """Pictures in order; unless it is live, a source can be read again from the start."""

    @property
    def count(self) -> int | None:
        """Number of pictures; None if it is not known."""
        ...

    @property
    def rate(self) -> float:
        """Pictures a second."""
        ...

    def __iter__(self) -> Iterator[Picture]: ...


@dataclass(frozen=True, slots=True)
class Folder:
    """Image files sorted by name, with numbers in names sorted by value."""

    files: tuple[Path, ...]
    rate: float = RATE

    @staticmethod
    def of(folder: Path, rate: float = RATE) -> Folder:
        """The images of a folder.

        Raises:
            ValueError: There are none, or the folder cannot be read.
        """
        files = [f for f in reading.names(folder) if f.suffix.lower() in SUFFIXES]
        if not files:
            raise ValueError(f"{folder}: there are no images in this folder")
        return Folder(tuple(files), rate)

    @property
    def count(self) -> int:
        return len(self.files)

    def __iter__(self) -> Iterator[Picture]:
        for index, file in enumerate(self.files):
            time = index / self.rate
            try:
                yield Picture(file.name, time, read_image(file))
            except ValueError as error:
                yield Picture(file.name, time, None, str(error).removeprefix(f"{file}: "))


@dataclass(frozen=True, slots=True)
class Video:
    """A video file."""

    path: Path
    rate: float
    count: int

    @staticmethod
    def of(path: Path) -> Video:
        """A video file that can be read.

        Raises:
            ValueError: It is not a video of a known format.
        """
        return Video(path, *video_file.describe(path))

    def __iter__(self) -> Iterator[Picture]:
        for index, image in enumerate(video_file.images(self.path, self.count)):
            yield Picture(f"frame {index}", index / self.rate, image)


@dataclass(frozen=True, slots=True)
class Live:
    """A camera of this machine."""

    number: int
    rate: float = RATE
    count: int | None = None

    def __iter__(self) -> Iterator[Picture]:
        with silent_libraries():
            capture = cv2.VideoCapture(self.number)
        if not capture.isOpened():
            raise ValueError(f"camera:{self.number}: there is no such camera")
        began = time.monotonic()
        for index in itertools.count():
            more, image = capture.read()
            if not more:
                break
            yield Picture(f"frame {index}", time.monotonic() - began, rgb(image))
        capture.release()


@dataclass(frozen=True, slots=True)
class Painted:
    """Pictures that a function paints from their numbers."""

    paint: Callable[[int], Image]
    count: int
    rate: float = RATE

    def __iter__(self) -> Iterator[Picture]:
        for index in range(self.count):
            image = self.paint(index)
            image.setflags(write=False)
            yield Picture(f"frame {index}", index / self.rate, image)
