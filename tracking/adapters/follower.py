"""A tracker that is given pictures one by one, as other toolkits do it."""

from __future__ import annotations

from typing import Any

from sim.types import Frame, Image
from tracking import create
from tracking.evaluation.sequences.quadrilateral import boxes
from tracking.types import Estimate, Region, State

Rect = tuple[float, float, float, float]
"""Left, top, width, height [px]."""


class Follower:
    """Keeps the time of pictures at a fixed rate."""

    def __init__(self, kind: str, seed: int, rate: float, settings: dict[str, Any]) -> None:
        self._kind, self._seed, self._rate, self._settings = kind, seed, rate, settings

    def start(self, image: Image, region: Region, state: State) -> None:
        """Begin anew: a target may be given as often as one likes."""
        self._tracker, self._count = create(self._kind, self._seed, **self._settings), 0
        self.region = region
        self._tracker.start(self._frame(image), region, state)

    def update(self, image: Image) -> tuple[Estimate, Rect]:
        """Find the target, with the upright box around it."""
        found = self._tracker.update(self._frame(image))
        left, top, width, height = boxes(found.outline(self.region)[None])[0].tolist()
        return found, (left, top, width, height)

    def _frame(self, image: Image) -> Frame:
        index, self._count = self._count, self._count + 1
        return Frame(image, index / self._rate, index)
