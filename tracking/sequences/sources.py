"""Sources of pictures: their protocol, the times of their pictures, and two sources: folders of
image files, and pictures that a function paints.
"""

import itertools
import math
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Protocol

from sim.files import reading
from sim.files.bit_depth import BitDepth
from sim.files.picture_file import SUFFIXES, read_image
from sim.types import Image

RATE = 30.0
"""Default rate of folders and cameras [pictures a second]."""
SECOND = 1_000_000_000
"""A second [ns]."""
NANO = 1e-9
"""A nanosecond [s]."""
SET_BACK = 1.0
"""A source whose stamps go back by more has set its clock [s]; chosen by hand."""
SET_FORWARD = 86_400.0
"""A source whose stamps go forward by more has set its clock [s]; chosen by hand."""
CLOSE = 1e-4
"""Time given to two pictures whose stamps are in a wrong order [s]; chosen by hand."""
NUMBER = re.compile(r"\d+", re.ASCII)
REPEATED = 0.5
"""Longest time given to two pictures with the same stamp [s]; chosen by hand."""


@dataclass(frozen=True, slots=True)
class Picture:
    """One picture of a source, RGB (H, W, 3), with its time since the first picture [s] and, if the
    source has them, its time stamp [ns] and the date and time at which it came. An image of None
    cannot be decoded, for the reason `reason`. `notes` has sentences about the source for the user;
    `damaged` is True if FFmpeg has concealed damage of the image.
    """

    name: str
    """File name, "frame 12" or, in a bag, "message 12"."""
    time: float
    """Time since the first picture [s]."""
    image: Image | None
    """RGB (H, W, 3), read-only; None if it cannot be decoded."""
    reason: str = "it cannot be decoded"
    """The reason why the image is missing, for messages."""
    stamp: int | None = None
    """Time stamp of the source [ns]: of a bag, usually since 1970; of a video, as its file states
    it; None if the source has none."""
    notes: tuple[str, ...] = ()
    """Sentences about the source for the user; all later pictures that can be decoded repeat
    them."""
    came: datetime | None = None
    """Date and time at which the picture of a camera or stream came; None for other sources."""
    damaged: bool = False
    """True if FFmpeg has concealed damaged parts of the image."""


@dataclass(frozen=True, slots=True)
class End:
    """Report on how the reading of a source ended: a sentence for the user, whether the source
    broke off or is damaged (`lost`), the number of pictures that were skipped because the tracker
    was busy (`dropped`; they do not make it `lost`), and the number of damaged ones.
    """

    sentence: str
    """The report for the user."""
    lost: bool = False
    """True if pictures are missing or damaged: the stream broke off, or the file is damaged."""
    dropped: int = 0
    """Number of pictures of a stream that came while the tracker was busy, and were not used."""
    damaged: int = 0
    """Number of damaged pictures; of a stream, including those that cannot be decoded."""


class Source(Protocol):
    """Protocol of a source of pictures, which are iterated in order. A new iteration begins with
    the first picture, except for cameras and streams, which can be read only once.
    """

    @property
    def count(self) -> int | None:
        """Number of pictures of the source; None if it is unknown, as for a stream."""

    @property
    def rate(self) -> float:
        """Rate of the pictures [1/s]; of a stream, valid from its first picture on."""
        ...

    @property
    def end(self) -> End | None:
        """Report on the pictures of the last iteration, or of a stream so far, such as missing,
        dropped or damaged ones; None: there is nothing to report. A picture of a folder or a bag
        that cannot be decoded is not reported here, but has no image.
        """

    def __iter__(self) -> Iterator[Picture]: ...


class Times:
    """Converts the time stamps [ns] of a source's pictures, one after the other, to times since the
    first one [s], each later than the one before; `rate` is the approximate rate of the pictures
    [1/s].
    """

    def __init__(self, rate: float) -> None:
        """Begin before the first picture; `rate` is the approximate rate of the pictures [1/s]."""
        self._gap = 1.0 / rate
        self._last = -self._gap
        self._zero: float | None = None
        self._stamp: int | None = None

    def since_first(self, stamp: int | None) -> float:
        """Return the time of the next picture since the first one [s], by its stamp [ns]; None: it
        has no stamp.

        A picture without a stamp, or with the stamp of the last one, comes one period of the rate
        after the last one (with the same stamp at most 0.5 s). Stamps that go back by less than 1 s
        are replaced by times 0.1 ms after each other. A larger step back, or one forward by a day,
        means that the source's clock was set: times continue one period after the last.
        """
        time = self._last + self._gap
        if stamp is not None:
            # Whole seconds are converted apart: a float of ns since 1970 has steps of 256 ns.
            stated = stamp // SECOND + NANO * (stamp % SECOND)
            ahead = -math.inf if self._zero is None else stated - self._zero - self._last
            if stamp == self._stamp:
                time = self._last + min(self._gap, REPEATED)
            elif -SET_BACK < ahead < SET_FORWARD:
                time = self._last + max(ahead, CLOSE)
            else:
                self._zero = stated - time
            self._stamp = stamp
        self._last = time
        return time


def timed(pictures: Iterable[Picture], rate: float) -> Iterator[Picture]:
    """Yield pictures with their times since the first one [s], which follow from their stamps.

    Pictures that cannot be decoded and have no stamp are spread evenly up to the next picture;
    where none follows, they come at the rate.

    Args:
        pictures: Pictures with stamps, whose `time` is not used.
        rate: Approximate rate of the pictures [1/s].
    """
    times = Times(rate)
    waiting: list[Picture] = []
    last = math.nan
    for picture in pictures:
        if picture.stamp is None and picture.image is None and not math.isnan(last):
            waiting.append(picture)
            continue
        time = times.since_first(picture.stamp)
        step = (time - last) / (len(waiting) + 1)
        for k, blind in enumerate(waiting, 1):
            yield replace(blind, time=last + k * step)
        waiting.clear()
        yield replace(picture, time=time)
        last = time
    for blind in waiting:
        yield replace(blind, time=times.since_first(None))


def images_in(folder: Path) -> list[Path]:
    """Return the paths of a folder's image files (those with a suffix such as .jpg), sorted by name
    with the numbers in names by value; hidden files such as those of macOS are left out. An empty
    list: there are none.

    Raises:
        ValueError: There is no such folder, or it cannot be read.
    """
    return [
        file
        for file in reading.names(folder)
        if file.suffix.lower() in SUFFIXES and not file.name.startswith(".")
    ]


@dataclass(frozen=True, slots=True)
class Folder:
    """Source of the image files of a folder, in the order of `files`, at a rate [1/s]; `notes` has
    sentences for the user, `end` is always None.
    """

    files: tuple[Path, ...]
    rate: float = RATE
    """Rate of the pictures [1/s]."""
    end: End | None = None
    notes: tuple[str, ...] = ()
    """Sentences about the source for the user."""

    @staticmethod
    def of(folder: Path, rate: float = RATE) -> "Folder":
        """Return the source of a folder's images at a rate [1/s], sorted by name with the numbers
        in names by value. If more than half of the names have numbers, files without a number are
        left out.

        Raises:
            ValueError: The folder has no images, or cannot be read.
        """
        files = images_in(folder)
        if not files:
            raise ValueError(
                f"{folder}: there are no images in this folder: give one with JPEG, PNG, BMP, "
                "TIFF, WebP or PPM files"
            )
        others = [file for file in files if not NUMBER.search(file.stem)]
        if not others or 2 * len(others) >= len(files):
            return Folder(tuple(files), rate)
        note = f"pictures without a number in the name are left out: {len(others)}, the first is "
        numbered = tuple(file for file in files if file not in others)
        return Folder(numbered, rate, notes=(note + others[0].name,))

    @property
    def count(self) -> int:
        return len(self.files)

    def __iter__(self) -> Iterator[Picture]:
        depth = BitDepth()
        gaps = _gaps(self.files)
        for index, file in enumerate(self.files):
            time = index / self.rate
            try:
                image = read_image(file, depth)
                yield Picture(file.name, time, image, notes=(*self.notes, *gaps, *depth.notes))
            except ValueError as error:
                yield Picture(file.name, time, None, str(error).removeprefix(f"{file}: "))


def _gaps(files: Sequence[Path]) -> list[str]:
    """Return a list with one sentence if numbers are missing in the names of files, else an empty
    list.

    Numbers are missing where the step between two names exceeds the most common step. Names that
    differ in more than one number or in their other characters, or whose steps mostly differ (as
    time stamps do), are not judged.
    """
    if len({tuple(NUMBER.split(file.stem)) for file in files}) > 1:
        return []
    columns = zip(*(map(int, NUMBER.findall(file.stem)) for file in files), strict=True)
    counting = [column for column in columns if len(set(column)) > 1]
    if len(counting) != 1:
        return []
    steps = [after - before for before, after in itertools.pairwise(counting[0])]
    ((usual, times),) = Counter(steps).most_common(1)
    places = [place for place, step in enumerate(steps) if step > usual]
    if not places or usual <= 0 or 2 * times <= len(steps):
        return []
    many = sum(steps[place] // usual - 1 for place in places)
    first = places[0]
    return [
        f"by the numbers in the names {many} pictures are missing, the first after "
        f"{files[first].name}; each picture is still taken as one period after the one before"
    ]


@dataclass(frozen=True, slots=True)
class PaintedSource:
    """Source of `count` pictures, RGB (H, W, 3), that the function `paint` returns for the numbers
    0 to count - 1; they come at `rate` [1/s], and `end` is always None.
    """

    paint: Callable[[int], Image]
    """Returns the picture of a number, RGB (H, W, 3); the first is 0."""
    count: int
    """Number of pictures."""
    rate: float = RATE
    """Rate of the pictures [1/s]."""
    end: End | None = None

    def __iter__(self) -> Iterator[Picture]:
        for index in range(self.count):
            image = self.paint(index)
            image.setflags(write=False)
            yield Picture(f"frame {index}", index / self.rate, image)
