"""Our trackers in OpenCV's convention."""

from typing import Any

import numpy as np

from sim.files.picture_file import rgb
from tracking.adapters.follower import Follower, Rect
from tracking.sequences.sources import RATE
from tracking.types import Status


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
        self._follower.start(rgb(image), rect)

    def update(self, image: np.ndarray) -> tuple[bool, Rect]:
        """Whether the target is seen, and its box: unlike OpenCV's own, false when it is not."""
        found, rect = self._follower.update(rgb(image))
        return found.status is Status.LOCKED, rect
