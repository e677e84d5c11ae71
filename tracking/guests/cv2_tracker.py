"""OpenCV's own trackers by their names. An error of OpenCV at the start, or of a model file in the
first update, becomes a ValueError with one sentence; a later one means that the target is not seen.
"""

import ctypes
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from sim.files import reading
from sim.stderr import silent_libraries
from sim.types import Image
from tracking.guests.boxes import Box

MODELS = {
    "Nano": ("backbone", "neckhead"),
    "Vit": ("net",),
    "DaSiamRPN": ("model", "kernel_cls1", "kernel_r1"),
}
"""Names of the model files of OpenCV's neural trackers, in order; these trackers have a score."""
LEAST_MIL = 5
"""Least length of the longer side of MIL's box [px]: in a smaller box OpenCV never returns."""
CONTRIB = ("CSRT", "KCF")
"""Trackers that only OpenCV's additional modules have."""
REMEDY = (
    " (uninstall every opencv package, then install opencv-contrib-python-headless: whichever is "
    "installed last is used)"
)
"""End of the message where an OpenCV without the additional modules is installed."""


class Cv2Tracker:
    """One of OpenCV's own trackers, by its name, for pictures in BGR. `models` are the paths of its
    model files, in the order of `MODELS`; `seed` is that of OpenCV's random numbers.

    A model file that cannot be used raises a ValueError in the constructor, in `init` or in the
    first `update`. Other errors of OpenCV in `update`, such as for a box that has left the picture,
    mean that the target is not seen.
    """

    def __init__(self, name: str, models: Sequence[str], seed: int) -> None:
        """Create OpenCV's tracker of a name; `init` must be called before `update`.

        Args:
            name: Name of the tracker, such as "MIL".
            models: Paths of its model files, in the order of `MODELS`.
            seed: Seed of OpenCV's random numbers.

        Raises:
            ValueError: This OpenCV has no such tracker, the tracker needs other model files, or one
                cannot be read.
        """
        self._name = name
        self._models = [Path(model) for model in models]
        seed_opencv(seed)
        self._tracker = self._made()
        self._proven = False

    def init(self, image: Image, box: Box) -> object:
        """Learn the target in a box (left, top, width, height) [px] of the first picture, BGR (H,
        W, 3).

        Returns:
            OpenCV's answer: False if it refuses the box.

        Raises:
            ValueError: The box is too small for MIL, or OpenCV fails on the box or the model files.
        """
        self._size = image.shape
        if self._name == "MIL" and max(box[2:]) < LEAST_MIL:
            raise ValueError(
                f"the region is {box[2]} x {box[3]} px; {self._place()} needs a side of at least "
                f"{LEAST_MIL} px: give a larger region"
            )
        height, width = image.shape[:2]
        with self._named(f" (region: {box[2]} x {box[3]} px, picture: {width} x {height} px)"):
            return self._tracker.init(image, box)

    def update(self, image: Image) -> tuple[bool, Sequence[float]]:
        """Return True and the target's box x, y, width, height [px] in the next picture, BGR (H, W,
        3). The first is False, and the box means nothing, where the target is not seen, or the
        picture does not have the size of the first one.

        Raises:
            ValueError: OpenCV fails on the first picture of a tracker with model files: they do not
                fit each other or this tracker.
        """
        if image.shape != self._size:
            return False, ()
        try:
            with self._named():
                found, box = self._tracker.update(image)
        except ValueError:
            if self._models and not self._proven:
                raise
            return False, ()
        self._proven = True
        return found and min(box[2:]) > 0, box

    def score(self) -> float:
        """Return the score that one of OpenCV's neural trackers gave in the last `update`, from 0
        (lost) to 1 (certain): clipped to this range, and 0 where it is nan.
        """
        return float(np.clip(np.nan_to_num(self._tracker.getTrackingScore()), 0, 1))

    def _made(self) -> Any:
        """Return a new object of OpenCV's tracker, made with its model files.

        Raises:
            ValueError: This OpenCV has no such tracker, the number of model files is wrong, or one
                cannot be read.
        """
        create = creator_of(self._name)
        parts = MODELS.get(self._name, ())
        if len(self._models) != len(parts):
            files = ", ".join(parts) or "none"
            raise ValueError(
                f"the setting model gives OpenCV's tracker {self._name} {len(self._models)} files; "
                f"their number should be {len(parts)} ({files})"
            )
        for path in self._models:
            reading.opened(path, "model").close()  # OpenCV's own message names no file
        if not parts:
            return create()
        settings = getattr(cv2, f"Tracker{self._name}_Params")()
        for part, path in zip(parts, self._models, strict=True):
            setattr(settings, part, str(path))
        with self._named():
            return create(settings)

    @contextmanager
    def _named(self, end: str = "") -> Generator[None]:
        """Turn OpenCV's errors in the block into a ValueError with the tracker's name and files.

        Args:
            end: End of the message, after OpenCV's reason.
        """
        try:
            with silent_libraries():
                yield
        except cv2.error as error:
            raise ValueError(f"{self._place()}: {_reason(error)}{end}") from None

    def _place(self) -> str:
        """Return the tracker's name and model files, to begin a message."""
        files = ", ".join(map(str, self._models))
        return f"OpenCV's {self._name} with {files}" if files else f"OpenCV's {self._name}"


def creator_of(name: str) -> Callable[..., Any]:
    """Return OpenCV's function that makes a tracker of a name, such as "MIL".

    Raises:
        ValueError: This OpenCV has no such tracker; the message lists the trackers that it has.
    """
    found = getattr(cv2, f"Tracker{name}", None)
    if found is not None and hasattr(found, "create"):
        return found.create
    there = [
        n.removeprefix("Tracker")
        for n in dir(cv2)
        if hasattr(getattr(cv2, n), "create") and n.startswith("Tracker") and n != "Tracker"
    ]
    raise ValueError(
        f"OpenCV {running()} has no tracker '{name}'{REMEDY if name in CONTRIB else ''}; "
        f"it has {', '.join(sorted(there))}"
    )


def running() -> str:
    """Return the version of the imported OpenCV and whether it has the additional modules, as a
    text such as "4.12.0 with the additional modules". Package metadata may be wrong: two packages
    of OpenCV overwrite each other's files.
    """
    contrib = hasattr(cv2, "TrackerCSRT")
    return f"{cv2.__version__} {'with' if contrib else 'without'} the additional modules"


def seed_opencv(seed: int) -> None:
    """Seed the random numbers of OpenCV's trackers: OpenCV's own generator, and the C library's
    rand(), both for the whole process.
    """
    cv2.setRNGSeed(seed)
    # MIL draws its features with the C library's rand(), which OpenCV's seed does not reach.
    ctypes.CDLL(None).srand(seed)


def _reason(error: cv2.error) -> str:
    """Return the text of an error of OpenCV, without version, file and line."""
    return " ".join(str(getattr(error, "err", "") or error).split())
