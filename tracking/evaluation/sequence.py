"""A sequence: pictures, and where the target truly is in them; read from the field's layouts."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sim.types import Array
from tracking.evaluation import truth as truths
from tracking.evaluation.sources import SUFFIXES, Folder, Live, Source, Video
from tracking.types import Region, State

IMAGE_FOLDERS = ("img", "color", "imgs", "images", "frames")
"""Where OTB and VOT keep a sequence's pictures, beside its truth."""
TRUTHS = ("groundtruth_rect*.txt", "groundtruth*.txt", "truth.csv", "groundtruth.csv")
CAMERA = "camera:"
CAMERA_DIGITS = 3


@dataclass(frozen=True, slots=True)
class Sequence:
    """Pictures with truth."""

    name: str
    family: str
    """What it is counted with, such as "clutter-a"."""
    source: Source
    truth: Array
    """Corners (n, 4, 2) of the target [px]; nan where it is absent."""
    region: Region
    """The template, as it is in the first picture."""
    start: State
    """Where it is there."""
    states: Array | None = None
    """x, y, theta, scale (n, 4), where they are known exactly."""

    @staticmethod
    def of_states(
        name: str, family: str, source: Source, region: Region, states: Array
    ) -> Sequence:
        """A sequence whose exact states (n, 4) are known: x, y, theta, scale."""
        corners = np.stack([region.corners(State(*row)) for row in states.tolist()])
        first = State(*states[0].tolist())
        return Sequence(name, family, source, corners, region, first, states)


def is_folder(path: Path) -> bool:
    """Whether there is such a folder; a name that no file can have is none."""
    try:
        return path.is_dir()
    except OSError:
        return False


def source_of(text: str, rate: float) -> Source:
    """Pictures of a folder (also in OTB's and VOT's layouts), a video file, or "camera:0".

    Raises:
        ValueError: There is no such thing, or nothing in it.
    """
    if text.startswith(CAMERA):
        number = text.removeprefix(CAMERA)
        if not number.isdecimal() or len(number) > CAMERA_DIGITS:
            raise ValueError(f"{text}: a camera is given by its number, such as camera:0")
        return Live(int(number))
    path = Path(text)
    try:
        if path.is_dir():
            return Folder.of(pictures_in(path), rate)
        if path.is_file():
            return Video.of(path)
    except OSError as error:
        raise ValueError(f"{text}: cannot read this: {error.strerror}") from None
    raise ValueError(f"{text}: there is no such folder, video file, or camera:NUMBER")


def pictures_in(folder: Path) -> Path:
    """The folder itself, or the one below it where OTB or VOT keep the pictures."""
    if any(f.suffix.lower() in SUFFIXES for f in folder.iterdir()):
        return folder
    below = (folder / name for name in IMAGE_FOLDERS)
    return next((path for path in below if path.is_dir()), folder)


def truths_in(folder: Path) -> list[Path]:
    """The truth files beside a sequence's pictures, sorted; one for each target."""
    for place in (folder, folder.parent) if folder.name in IMAGE_FOLDERS else (folder,):
        for pattern in TRUTHS:
            found = sorted(place.glob(pattern))
            if found:
                return found
    return []


def read_folder(folder: Path, rate: float) -> list[Sequence]:
    """The sequences of one folder, one for each truth file.

    Raises:
        ValueError: There are no pictures, or a truth is not readable.
    """
    source, found = Folder.of(pictures_in(folder), rate), truths_in(folder)
    several = len(found) > 1
    return [
        _read(f"{folder.name}-{i}" if several else folder.name, source, path)
        for i, path in enumerate(found, 1)
    ]


def read_all(folder: Path, rate: float) -> list[Sequence]:
    """The sequences of a folder, or of all folders in it that hold one.

    Raises:
        ValueError: There is none.
    """
    if not is_folder(folder):
        raise ValueError(f"{folder}: there is no such folder of sequences")
    places = [folder] if truths_in(folder) else sorted(p for p in folder.iterdir() if p.is_dir())
    found = [s for place in places if truths_in(place) for s in read_folder(place, rate)]
    if not found:
        raise ValueError(f"{folder}: there is no sequence (pictures with a truth file) in it")
    return found


def _read(name: str, source: Folder, path: Path) -> Sequence:
    corners = truths.read(path)[: source.count]
    present = np.flatnonzero(np.isfinite(corners).all(axis=(1, 2)))
    if len(present) == 0 or present[0] != 0:
        raise ValueError(f"{path}: the target is not in the first picture")
    files = source.files[: len(corners)]
    region, start = truths.placement(corners[0])
    return Sequence(name, name, Folder(files, source.rate), corners, region, start)
