"""OpenCV's CamShift (Bradski 1998) on the back-projection of a hue histogram: a reference."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import cv2
import numpy as np

from sim.types import Frame
from tracking.lock import Lock
from tracking.trackers._opencv import HueModel, HueSettings, box_of
from tracking.types import Estimate, Region, State, check_region

SMALLEST_BOX = 4
"""A window that shrank below this begins at this size again [px]."""


@dataclass(frozen=True, slots=True)
class Config(HueSettings):
    """Histogram and iterations."""

    def build(self, rng: np.random.Generator) -> Camshift:
        """The tracker; draws nothing."""
        return Camshift(self)


@final
class Camshift:
    """A box whose size and angle follow the moments of the back-projection."""

    def __init__(self, config: Config) -> None:
        self._config = config

    def start(self, frame: Frame, region: Region, state: State) -> None:
        """Learn the histogram."""
        check_region(frame, region, state)
        self._region, self._state, self._lock = region, state, Lock(self._config.lock)
        self._box = box_of(region, state, frame.image)
        self._model = HueModel(frame.image, self._box, self._config)

    def update(self, frame: Frame) -> Estimate:
        """Shift and fit the box; where nothing looks like the target it stays."""
        height, width = frame.image.shape[:2]
        x, y, w, h = self._box
        w, h = min(max(w, SMALLEST_BOX), width), min(max(h, SMALLEST_BOX), height)
        window = (min(max(x, 0), width - w), min(max(y, 0), height - h), w, h)
        ends = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, self._config.steps, 1)
        likely = self._model.back_projection(frame.image)
        fitted, box = cv2.CamShift(likely, window, ends)
        (u, v), (a, b), _ = fitted
        if a > 0 and b > 0:
            self._box = tuple(int(value) for value in box)  # type: ignore[assignment]
            scale = np.sqrt(a * b / (self._region.width * self._region.height))
            # CamShift's angle is that of an ellipse's axis, without front or back, and jumps for
            # round targets: the reference keeps the first angle, as its users do.
            self._state = State(float(u) + 0.5, float(v) + 0.5, self._state.theta, float(scale))
        here = box_of(self._region, self._state, frame.image)
        distance = self._model.distance(frame.image, here)
        status = self._lock.judge(distance, frame.time)
        return Estimate(self._state, np.zeros((4, 4)), distance, status, follows=(False, True))
