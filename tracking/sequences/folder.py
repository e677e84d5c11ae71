"""A folder of images as a source of pictures."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from sim.files import reading
from sim.files.picture_file import SUFFIXES, read_image
from tracking.sequences.sources import RATE, End, Picture


@dataclass(frozen=True, slots=True)
class Folder:
    """Image files sorted by name, with numbers in names sorted by value."""

    files: tuple[Path, ...]
    rate: float = RATE
    end: End | None = None

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
