"""Sequences (pictures with the target's true outlines), and sources of pictures by their names."""

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sim.files import reading
from sim.types import Array, Image
from tracking.sequences import stream
from tracking.sequences import truth as truths
from tracking.sequences.bag_file import Bag, is_bag
from tracking.sequences.quadrilateral import placement
from tracking.sequences.sources import Folder, PaintedSource, Source, images_in
from tracking.sequences.truth import Format
from tracking.sequences.video_file import Video
from tracking.types import Region, State

IMAGE_FOLDERS = ("img", "color", "imgs", "images", "frames")
"""Names of the folders with a sequence's pictures in OTB's and VOT's layouts."""
TRUTHS = ("groundtruth_rect*.txt", "groundtruth*.txt", "gt.txt", "truth.csv", "groundtruth.csv")
"""Patterns of the names of truth files; the first pattern that matches any file is used."""
CAMERA = "camera:"
"""Beginning of the name of a camera."""
CAMERA_DIGITS = 3
"""Most digits of a camera's number."""
THERE = "folder, video file, bag, camera:NUMBER, or address such as rtsp://HOST/PATH"
"""The kinds of sources, for messages."""
SEQUENCES = "give a folder with pictures and a truth file, or a folder of such folders"
"""End of a message about a folder without sequences."""


@dataclass(frozen=True, slots=True)
class Sequence:
    """n pictures of one target: its true corners (n, 4, 2) [px] in each, nan where it is absent;
    its size and its state in the first picture; and, if they are known exactly, its true states (n,
    4) of x, y [px], theta [rad], scale, else None.
    """

    name: str
    source: Source
    truth: Array
    """Corners (n, 4, 2) of the target [px]; nan in frames without it."""
    region: Region
    """Size of the target in the first picture [px]."""
    start: State
    """State of the target in the first picture."""
    states: Array | None = None
    """True x, y [px], theta [rad], scale (n, 4) if they are known exactly, else None."""

    @staticmethod
    def painted(
        name: str, paint: Callable[[int], Image], region: Region, states: Array
    ) -> "Sequence":
        """Return a sequence of painted pictures with the target's exact corners and states.

        Args:
            name: Name of the sequence.
            paint: Function that returns the picture with a number, RGB (H, W, 3); the first is 0.
            region: Size of the target at scale 1 [px].
            states: Exact x, y [px], theta [rad], scale of the target in each picture (n, 4).
        """
        source = PaintedSource(paint, len(states))
        corners = np.stack([region.corners(State(*row)) for row in states.tolist()])
        return Sequence(name, source, corners, region, State(*states[0].tolist()), states)


def is_folder(path: Path) -> bool:
    """Return True if a path is a folder; False also for a path that is missing or that no file can
    have.
    """
    return os.path.isdir(path)  # noqa: PTH112 (Path's raises for such a name)


def source_of(text: str, rate: float, topic: str | None = None) -> Source:
    """Return the source of pictures that a text names.

    Args:
        text: A folder (also in OTB's and VOT's layouts), a video file, a bag (recorded messages of
            ROS or MCAP), the address of a stream, or a camera such as "camera:0".
        rate: Rate of a folder's pictures [1/s]; not used for other sources.
        topic: Topic of a bag; None: the only topic with pictures.

    Raises:
        ValueError: There is no such source, or it cannot be read; a folder has no pictures; a bag
            has several topics with pictures or none of this name; or a topic is given for another
            source than a bag. Cameras and streams are opened, and fail, only when they are read.
    """
    path = Path(text)
    is_address = stream.ADDRESS.match(text)
    if not is_address and is_bag(path):
        return Bag(path, topic)
    if topic is not None:
        raise ValueError(
            f"{stream.shown(text)}: this is not a bag that can be read, and only bags have topics: "
            f"correct the name, or leave the topic '{topic}' out"
        )
    if is_address:
        return stream.stream(text)
    if text.startswith(CAMERA):
        number = text.removeprefix(CAMERA)
        if not number.isdecimal() or len(number) > CAMERA_DIGITS:
            raise ValueError(f"{text}: a camera is given by its number, such as camera:0")
        return stream.camera(int(number))
    if is_folder(path):
        return Folder.of(pictures_in(path), rate)
    if not os.path.lexists(path):
        raise ValueError(f"{text}: there is no such source: give a {THERE}")
    return Video.of(path)


def pictures_in(folder: Path) -> Path:
    """Return the folder with the pictures of a sequence. It is `folder` itself if this has
    pictures; otherwise the folder in it with a name such as "img", as in the layouts of OTB and
    VOT; and `folder` again if there is no such folder.

    Raises:
        ValueError: The folder cannot be read.
    """
    if images_in(folder):
        return folder
    below = (folder / name for name in IMAGE_FOLDERS)
    return next((path for path in below if is_folder(path)), folder)


def truths_in(folder: Path) -> list[Path]:
    """Return the truth files (true outlines of a target) in a sequence's folder, one for each
    target, sorted by name; an empty list if it has none. If `folder` is that of the pictures, such
    as "img", and has no truth file, the folder above is searched.

    Raises:
        ValueError: The folder cannot be read.
    """
    for place in (folder, folder.parent) if folder.name in IMAGE_FOLDERS else (folder,):
        for pattern in TRUTHS:
            found = [path for path in reading.names(place) if path.match(pattern)]
            if found:
                return found
    return []


def truth_of(source: str) -> Path | None:
    """Return the truth file (true outlines of the target) of a source of pictures, named as for
    `source_of`; None if the source is not a folder or has no such file.

    Raises:
        ValueError: The folder has several truth files, or cannot be read.
    """
    if source.startswith(CAMERA) or not is_folder(Path(source)):
        return None
    found = truths_in(Path(source))
    if len(found) > 1:
        names = ", ".join(path.name for path in found)
        raise ValueError(
            f"{source}: there are several truth files ({names}); choose one with --truth, or with "
            "recording.truth in a scenario"
        )
    return found[0] if found else None


def check_truth(
    truth: Array, source: Source, place: str, form: Format, *, start_is_enough: bool = False
) -> None:
    """Check that the true outlines of a target, read from a truth file, fit the number of the
    pictures, if it is known, and for `Format.AUTO` also their size.

    Args:
        truth: True corners (n, 4, 2) of the target [px].
        source: The pictures; for `Format.AUTO` the first one is read.
        place: Path of the truth file, for messages.
        form: The format in which the file was read.
        start_is_enough: Accept an outline in the first picture alone (n = 1).

    Raises:
        ValueError: The number of lines is not that of the pictures; or, for `Format.AUTO`, the
            numbers may be two corners instead of a box.
    """
    is_start = start_is_enough and len(truth) == 1
    if source.count is not None and len(truth) != source.count and not is_start:
        raise ValueError(truths.other_count(place, len(truth), source.count))
    first = next(iter(source), None) if form is Format.AUTO else None
    if first is not None and first.image is not None:
        height, width = first.image.shape[:2]
        truths.check_boxes(truth, (width, height), place)


def read_folder(folder: Path, rate: float, form: Format = Format.AUTO) -> list[Sequence]:
    """Return the sequences of one folder of pictures, one for each truth file (true outlines of a
    target); an empty list without a truth file.

    Args:
        folder: The folder, also in OTB's and VOT's layouts.
        rate: Rate of the pictures [1/s].
        form: Format of the truth files.

    Raises:
        ValueError: The folder has no pictures, a truth cannot be read or does not fit the pictures,
            or the target is not in the first picture.
    """
    source = Folder.of(pictures_in(folder), rate)
    found = truths_in(folder)
    sequences: list[Sequence] = []
    for number, path in enumerate(found, 1):
        corners = truths.read(path, form, source.count)
        check_truth(corners, source, str(path), form)
        if not np.isfinite(corners[0]).all():
            raise ValueError(
                f"{path}: the first line has no outline of the target, with which a sequence must "
                "begin: leave out the pictures and lines before the target appears"
            )
        name = f"{folder.name}-{number}" if len(found) > 1 else folder.name
        sequences.append(Sequence(name, source, corners, *placement(corners[0])))
    return sequences


def read_all(folder: Path, rate: float, form: Format = Format.AUTO) -> list[Sequence]:
    """Return the sequences (pictures with a target's true outlines) of a folder or, if it has
    neither pictures nor outlines itself, of all folders in it.

    Args:
        folder: The folder; folders in it with neither pictures nor truth are ignored.
        rate: Rate of the pictures [1/s].
        form: Format of the truth files.

    Raises:
        ValueError: There is no sequence, or a folder is incomplete or cannot be read.
    """
    if not is_folder(folder):
        raise ValueError(f"{folder}: there is no such folder of sequences: {SEQUENCES}")
    if _is_sequence(folder):
        return read_folder(folder, rate, form)
    places = [place for place in reading.names(folder) if _is_sequence(place)]
    found = [sequence for place in places for sequence in read_folder(place, rate, form)]
    if not found:
        raise ValueError(f"{folder}: there is no sequence in this folder: {SEQUENCES}")
    return found


def _is_sequence(path: Path) -> bool:
    """Return True if a path is a folder with pictures and a truth, False if it has neither.

    Raises:
        ValueError: The folder has only one of the two, or cannot be read; or the path is a broken
            link.
    """
    if path.is_symlink() and not path.exists():
        raise ValueError(f"{path}: this link is broken: remove it")
    if not is_folder(path):
        return False
    pictures = images_in(pictures_in(path))
    truth = truths_in(path)
    if pictures and not truth:
        raise ValueError(
            f"{path}: there are pictures in this folder, but no truth file: add one, such as "
            "groundtruth.txt or truth.csv, or leave this folder out"
        )
    if truth and not pictures:
        raise ValueError(
            f"{path}: there is a truth file in this folder, but no picture: add the pictures, or "
            "leave this folder out"
        )
    return bool(truth)
