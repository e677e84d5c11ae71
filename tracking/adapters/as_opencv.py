"""Our trackers in OpenCV's convention."""

from typing import Any

import numpy as np

from sim.files.picture_file import rgb
from tracking.adapters.follower import Follower, Rect
from tracking.sequences.sources import RATE
from tracking.types import Status


class OpenCVTracker:
    """OpenCV's convention: BGR pictures, `init(image, rect)`, `update(image) -> (ok, rect)`.

    Example:
        >>> import numpy as np
        >>> image = np.random.default_rng(0).integers(0, 256, (240, 320, 3), dtype=np.uint8)
        >>> tracker = OpenCVTracker("mk_ssd")
        >>> tracker.init(image, (130, 105, 60, 30))
        >>> ok, (left, top, width, height) = tracker.update(image)
        >>> ok, round(left), round(top), round(width), round(height)
        (True, 130, 105, 60, 30)
    """

    def __init__(self, kind: str, seed: int = 0, rate: float = RATE, **settings: Any) -> None:
        """Choose a tracker by its kind; see `tracking.create`."""
        self._follower = Follower(kind, seed, rate, settings)

    def init(self, image: np.ndarray, rect: Rect) -> None:
        """Learn the target.

        Raises:
            ValueError: The rectangle is empty, or most of it is outside the picture.
        """
        self._follower.start(rgb(image), rect)

    def update(self, image: np.ndarray) -> tuple[bool, Rect]:
        """Find the target.

        Returns:
            True if it is seen (OpenCV's own trackers also return that if it is not), and its box
            (left, top, width, height) [px].
        """
        found, rect = self._follower.update(rgb(image))
        return found.status is Status.LOCKED, rect
