"""OpenCV's meanShift on the back-projection of a hue histogram: a reference, not ours."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import cv2
import numpy as np

from sim.types import Array, Frame
from tracking.external.boxes import box_of
from tracking.lock import Lock
from tracking.trackers._opencv import HueModel, HueSettings
from tracking.types import Estimate, Region, State, check_region, unknown_covariance


@dataclass(frozen=True, slots=True)
class Config(HueSettings):
    """Histogram and iterations."""

    def build(self, rng: np.random.Generator) -> CvMeanShift:
        """The tracker; draws nothing."""
        return CvMeanShift(self)


@final
class CvMeanShift:
    """A box of fixed size."""

    def __init__(self, config: Config) -> None:
        self._config = config

    def start(self, frame: Frame, region: Region, state: State) -> None:
        """Learn the histogram."""
        check_region(frame, region, state)
        self._region, self._state, self._lock = region, state, Lock(self._config.lock)
        self._model = HueModel(frame.image, region, state, self._config)

    def update(self, frame: Frame, ego: Array | None = None) -> Estimate:
        """Shift the box."""
        box = box_of(self._region, self._state.moved(ego), frame.image)
        ends = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, self._config.steps, 1)
        _, box = cv2.meanShift(self._model.back_projection(frame.image), box, ends)
        x, y, width, height = (int(v) for v in box)
        self._state = State(x + width / 2, y + height / 2, self._state.theta, self._state.scale)
        distance = self._model.distance(frame.image, self._state)
        status = self._lock.judge(distance, frame.time)
        return Estimate(self._state, unknown_covariance(), distance, status, follows=(False, False))
