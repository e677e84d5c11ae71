"""Our trackers with the interfaces of OpenCV, GOT-10k and the VOT toolkit."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Protocol

import numpy as np

from sim.files.picture_file import read_image, rgb
from sim.types import Frame, Image
from tracking import create
from tracking.evaluation.sequences.quadrilateral import boxes, corners_of, placement
from tracking.evaluation.sequences.sources import RATE
from tracking.types import Estimate, Region, State, Status

Rect = tuple[float, float, float, float]
"""Left, top, width, height [px]."""


class Follower:
    """A tracker that is given pictures one by one, at a fixed rate."""

    def __init__(self, kind: str, seed: int, rate: float, settings: dict[str, Any]) -> None:
        self._kind, self._seed, self._rate, self._settings = kind, seed, rate, settings

    def start(self, image: Image, region: Region, state: State) -> None:
        """Begin anew: a target may be given as often as one likes."""
        self._tracker, self._count = create(self._kind, self._seed, **self._settings), 0
        self._region = region
        self._tracker.start(self._frame(image), region, state)

    def update(self, image: Image) -> tuple[Estimate, Rect]:
        """Find the target, with the upright box around it."""
        found = self._tracker.update(self._frame(image))
        left, top, width, height = boxes(self._region.corners(found.state)[None])[0].tolist()
        return found, (left, top, width, height)

    def _frame(self, image: Image) -> Frame:
        index, self._count = self._count, self._count + 1
        return Frame(image, index / self._rate, index)


class OpenCVTracker:
    """OpenCV's convention: BGR pictures, `init(image, rect)`, `update(image) -> (ok, rect)`."""

    def __init__(self, kind: str, seed: int = 0, rate: float = RATE, **settings: Any) -> None:
        """A tracker by its kind; see `tracking.create`."""
        self._follower = Follower(kind, seed, rate, settings)

    def init(self, image: np.ndarray, rect: Rect) -> None:
        """Learn the target.

        Raises:
            ValueError: The rectangle is empty, or most of it is outside the picture.
        """
        self._follower.start(rgb(image), *placement(corners_of(np.array(rect, dtype=float))))

    def update(self, image: np.ndarray) -> tuple[bool, Rect]:
        """Whether the target is seen, and its box: unlike OpenCV's own, false when it is not."""
        found, rect = self._follower.update(rgb(image))
        return found.status is Status.LOCKED, rect


class Got10kTracker:
    """GOT-10k's convention: a name, `init(image, box)`, `update(image) -> box`; RGB pictures of PIL
    or arrays, boxes of OTB's kind (pixels counted from 1).
    """

    is_deterministic = True

    def __init__(self, kind: str, seed: int = 0, rate: float = RATE, **settings: Any) -> None:
        """A tracker by its kind; see `tracking.create`."""
        self.name = kind
        self._follower = Follower(kind, seed, rate, settings)

    def init(self, image: Any, box: Any) -> None:
        """Learn the target.

        Raises:
            ValueError: The box is empty, or most of it is outside the picture.
        """
        corners = corners_of(np.array(box, dtype=float)) - 1.0
        self._follower.start(_array(image), *placement(corners))

    def update(self, image: Any) -> np.ndarray:
        """The box (4,)."""
        _, (left, top, width, height) = self._follower.update(_array(image))
        return np.array([left + 1.0, top + 1.0, width, height])


class VotHandle(Protocol):
    """What `vot.VOT("rectangle")` of the VOT toolkit's Python integration offers."""

    def region(self) -> Any:
        """The target in the first picture: x, y, width, height."""
        ...

    def frame(self) -> str | None:
        """The next picture's path; nothing at the end."""
        ...

    def report(self, region: Any, confidence: float) -> None:
        """Report the target's region to the toolkit."""
        ...


def run_vot(
    handle: VotHandle, kind: str, seed: int = 0, rate: float = RATE, **settings: Any
) -> None:
    """Follow a target for the VOT toolkit until it gives no more pictures.

    Raises:
        ValueError: A picture cannot be read or decoded, or is too large.
    """
    given = handle.region()
    follower = Follower(kind, seed, rate, settings)
    path = handle.frame()
    if not path:
        return
    rect = np.array([given.x, given.y, given.width, given.height], dtype=float)
    follower.start(read_image(Path(path)), *placement(corners_of(rect)))
    while path := handle.frame():
        found, (left, top, width, height) = follower.update(read_image(Path(path)))
        answer = type(given)(left, top, width, height)
        handle.report(answer, 1.0 - found.distance)


def _array(image: Any) -> Image:
    return np.ascontiguousarray(np.asarray(image, dtype=np.uint8))
