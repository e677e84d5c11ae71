"""OpenCV's TrackerMIL (Babenko, Yang, Belongie 2009): a reference, not ours.

It has no confidence of its own; distance and status come from a hue histogram of its box.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, final

import cv2
import numpy as np

from sim.types import Array, Frame
from tracking.external.boxes import box_of
from tracking.external.cv2_tracker import seed_opencv
from tracking.lock import Lock
from tracking.trackers._opencv import HueModel, HueSettings
from tracking.types import Estimate, Region, State, check_region, unknown_covariance

SEED_BITS = 31


@dataclass(frozen=True, slots=True)
class Config(HueSettings):
    """The histogram that judges; MIL itself keeps OpenCV's settings."""

    def build(self, rng: np.random.Generator) -> CvMil:
        """The tracker; OpenCV's own random state is seeded from the generator."""
        return CvMil(self, int(rng.integers(1 << SEED_BITS)))


@final
class CvMil:
    """A box of fixed size, found by an online boosted classifier."""

    def __init__(self, config: Config, seed: int) -> None:
        self._config, self._seed = config, seed

    def start(self, frame: Frame, region: Region, state: State) -> None:
        """Train the first classifier."""
        check_region(frame, region, state)
        seed_opencv(self._seed)
        self._region, self._state, self._lock = region, state, Lock(self._config.lock)
        box = box_of(region, state, frame.image)
        self._model = HueModel(frame.image, region, state, self._config)
        self._size = frame.image.shape
        self._mil: Any = cv2.TrackerMIL.create()
        try:
            self._mil.init(np.ascontiguousarray(frame.image), box)
        except cv2.error:
            raise ValueError(
                f"the region is {box[2]} x {box[3]} px in an image of {frame.image.shape[1]} x "
                f"{frame.image.shape[0]} px; MIL needs room around it to learn from"
            ) from None

    def update(self, frame: Frame, ego: Array | None = None) -> Estimate:
        """Classify around the last box: OpenCV's tracker takes no ego motion. A picture of another
        size cannot be compared.
        """
        if frame.image.shape == self._size:
            found, (x, y, width, height) = self._mil.update(np.ascontiguousarray(frame.image))
            if found:
                theta, scale = self._state.theta, self._state.scale
                self._state = State(x + width / 2, y + height / 2, theta, scale)
        distance = self._model.distance(frame.image, self._state)
        status = self._lock.judge(distance, frame.time)
        return Estimate(self._state, unknown_covariance(), distance, status, follows=(False, False))
