"""OpenCV's TrackerMIL (Babenko, Yang, Belongie 2009): a reference, not ours.

It has no confidence of its own; distance and status come from a hue histogram of its box.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, final

import cv2
import numpy as np

from sim.types import Array, Frame
from tracking.external.boxes import Box
from tracking.external.cv2_tracker import seed_opencv
from tracking.trackers._opencv import HueSettings, HueTracker
from tracking.types import State

SEED_BITS = 31


@dataclass(frozen=True, slots=True)
class Config(HueSettings):
    """The histogram that judges; MIL itself keeps OpenCV's settings."""

    def build(self, rng: np.random.Generator) -> CvMil:
        """The tracker; OpenCV's own random state is seeded from the generator."""
        return CvMil(self, int(rng.integers(1 << SEED_BITS)))


@final
class CvMil(HueTracker):
    """A box of fixed size, found by an online boosted classifier."""

    def __init__(self, config: Config, seed: int) -> None:
        super().__init__(config)
        self._seed = seed

    def _begin(self, frame: Frame, box: Box) -> None:
        """Train the first classifier."""
        seed_opencv(self._seed)
        self._size = frame.image.shape
        self._mil: Any = cv2.TrackerMIL.create()
        try:
            self._mil.init(np.ascontiguousarray(frame.image), box)
        except cv2.error:
            raise ValueError(
                f"the region is {box[2]} x {box[3]} px in an image of {frame.image.shape[1]} x "
                f"{frame.image.shape[0]} px; MIL needs room around it to learn from"
            ) from None

    def _found(self, frame: Frame, ego: Array | None) -> State:
        """Classify around the last box: OpenCV's tracker takes no ego motion. A picture of another
        size cannot be compared.
        """
        if frame.image.shape != self._size:
            return self._state
        found, (x, y, width, height) = self._mil.update(np.ascontiguousarray(frame.image))
        if not found:
            return self._state
        return State(x + width / 2, y + height / 2, self._state.theta, self._state.scale)
