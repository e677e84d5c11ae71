"""A tracker that is given pictures one by one, as other toolkits do it."""

from typing import Any

import numpy as np

from sim.types import Frame, Image
from tracking import create
from tracking.sequences.quadrilateral import boxes, corners_of, placement
from tracking.types import Estimate

Rect = tuple[float, float, float, float]
"""Left, top, width, height [px]."""


class Follower:
    """Keeps the time of pictures at a fixed rate."""

    def __init__(self, kind: str, seed: int, rate: float, settings: dict[str, Any]) -> None:
        self._kind = kind
        self._seed = seed
        self._rate = rate
        self._settings = settings

    def start(self, image: Image, numbers: Any, *, turned: bool = False) -> None:
        """Begin anew, as often as one likes, with a box (4,), or coordinates (8,) of corners [px].

        Args:
            image: The first picture.
            numbers: Left, top, width, height, or x and y of each corner.
            turned: Keep the rotation of corners that form a rectangle; else take the upright box.

        Raises:
            ValueError: The region is empty, or most of it is outside the picture.
        """
        corners = corners_of(np.array(numbers, dtype=float))
        self.region, state = placement(corners, turned=turned)
        self._tracker = create(self._kind, self._seed, **self._settings)
        self._count = 0
        self._tracker.start(self._frame(image), self.region, state)

    def update(self, image: Image) -> tuple[Estimate, Rect]:
        """Find the target, with the upright box around it."""
        found = self._tracker.update(self._frame(image))
        left, top, width, height = boxes(found.outline(self.region)[None])[0].tolist()
        return found, (left, top, width, height)

    def _frame(self, image: Image) -> Frame:
        index = self._count
        self._count = self._count + 1
        return Frame(image, index / self._rate, index)
