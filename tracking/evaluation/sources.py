"""Where pictures come from: a folder of images, a video file, a live camera, or a painter."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import cv2
import numpy as np

from sim.types import Image

SUFFIXES = frozenset({".jpg", ".jpeg", ".png", ".bmp", ".tif", ".tiff", ".webp", ".ppm", ".pgm"})
RATE = 30.0
"""Frames a second where nothing tells."""
GIVEN_UP = 100
"""A video whose next frames cannot be decoded this many times in a row has ended."""


@dataclass(frozen=True, slots=True)
class Picture:
    """One picture of a source, or the news that it cannot be read."""

    name: str
    """File name, or "frame 12"."""
    time: float
    """When it was taken, from the first on [s]."""
    image: Image | None
    """RGB (H, W, 3), read-only; None where it cannot be decoded."""


class Source(Protocol):
    """Pictures in order; can be read again from the start unless it is live."""

    @property
    def count(self) -> int | None:
        """How many there are, where that is known."""
        ...

    @property
    def rate(self) -> float:
        """Pictures a second."""
        ...

    def __iter__(self) -> Iterator[Picture]: ...


@dataclass(frozen=True, slots=True)
class Folder:
    """Image files, sorted by name."""

    files: tuple[Path, ...]
    rate: float = RATE

    @staticmethod
    def of(folder: Path, rate: float = RATE) -> Folder:
        """The images of a folder.

        Raises:
            ValueError: There are none.
        """
        files = sorted(f for f in folder.iterdir() if f.suffix.lower() in SUFFIXES)
        if not files:
            raise ValueError(f"{folder}: there are no images in this folder")
        return Folder(tuple(files), rate)

    @property
    def count(self) -> int:
        """Number of files."""
        return len(self.files)

    def __iter__(self) -> Iterator[Picture]:
        for index, file in enumerate(self.files):
            yield Picture(file.name, index / self.rate, read_image(file))


@dataclass(frozen=True, slots=True)
class Video:
    """A video file."""

    path: Path
    rate: float
    count: int | None

    @staticmethod
    def of(path: Path) -> Video:
        """A video that can be opened.

        Raises:
            ValueError: OpenCV cannot open it.
        """
        capture = cv2.VideoCapture(str(path))
        if not capture.isOpened():
            raise ValueError(f"{path}: this is no video that OpenCV can open")
        rate, count = capture.get(cv2.CAP_PROP_FPS), int(capture.get(cv2.CAP_PROP_FRAME_COUNT))
        capture.release()
        return Video(path, rate if rate > 0 else RATE, count if count > 0 else None)

    def __iter__(self) -> Iterator[Picture]:
        capture = cv2.VideoCapture(str(self.path))
        failures = 0
        for index in itertools.count():
            more, image = capture.read()
            failures = 0 if more else failures + 1
            known = self.count if self.count is not None else index if failures else index + 1
            if index >= known or failures > GIVEN_UP:
                break
            yield Picture(f"frame {index}", index / self.rate, rgb(image) if more else None)
        capture.release()


@dataclass(frozen=True, slots=True)
class Live:
    """A camera of this machine, until it is stopped."""

    number: int
    rate: float = RATE
    count: int | None = None

    def __iter__(self) -> Iterator[Picture]:
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
    """Pictures that a function paints, each from its number alone."""

    paint: Callable[[int], Image]
    count: int
    rate: float = RATE

    def __iter__(self) -> Iterator[Picture]:
        for index in range(self.count):
            image = self.paint(index)
            image.setflags(write=False)
            yield Picture(f"frame {index}", index / self.rate, image)


def read_image(file: Path) -> Image | None:
    """A picture as RGB (H, W, 3), whatever its depth and channels; None where it cannot be read."""
    try:
        data = np.fromfile(file, np.uint8)
        image = cv2.imdecode(data, cv2.IMREAD_COLOR) if data.size else None
    except (OSError, cv2.error):
        return None
    return None if image is None else rgb(image)


def rgb(image: np.ndarray) -> Image:
    """A picture in OpenCV's convention (grey, BGR or BGRA) as RGB (H, W, 3), read-only."""
    code = {2: cv2.COLOR_GRAY2RGB, 4: cv2.COLOR_BGRA2RGB}
    depth = image.ndim if image.ndim == 2 or image.shape[2] != 4 else 4
    if image.ndim == 3 and image.shape[2] == 1:
        image, depth = image[:, :, 0], 2
    turned = cv2.cvtColor(image, code.get(depth, cv2.COLOR_BGR2RGB)).astype(np.uint8, copy=False)
    turned.setflags(write=False)
    return turned
