"""OpenCV's CamShift (Bradski 1998) on the back-projection of a hue histogram: a reference."""

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
        self._state, self._lock = state, Lock(self._config.lock)
        self._model = HueModel(frame.image, region, state, self._config)
        self._box = box_of(region, state, frame.image)
        # Its size is that of an ellipse of its own: only the ratio to the first means anything.
        fitted = self._fit(frame)
        self._first = (
            (region.width * region.height, state.scale)
            if fitted is None
            else (fitted[2], state.scale)
        )

    def update(self, frame: Frame, ego: Array | None = None) -> Estimate:
        """Shift and fit the box; where nothing resembles the target it stays."""
        if ego is not None:
            x, y, width, height = self._box
            self._box = (x + round(ego[0]), y + round(ego[1]), width, height)
        fitted = self._fit(frame)
        if fitted is not None:
            x, y, area = fitted
            first, scale = self._first
            # Its angle is an ellipse's, without front or back, and jumps for round targets: the
            # reference keeps the first angle, as its users do.
            self._state = State(x, y, self._state.theta, scale * float(np.sqrt(area / first)))
        distance = self._model.distance(frame.image, self._state)
        status = self._lock.judge(distance, frame.time)
        return Estimate(self._state, unknown_covariance(), distance, status, follows=(False, True))

    def _fit(self, frame: Frame) -> tuple[float, float, float] | None:
        """Centre and area of the ellipse that CamShift finds [px]; None where it finds nothing."""
        height, width = frame.image.shape[:2]
        x, y, w, h = self._box
        w, h = min(max(w, SMALLEST_BOX), width), min(max(h, SMALLEST_BOX), height)
        window = (min(max(x, 0), width - w), min(max(y, 0), height - h), w, h)
        ends = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, self._config.steps, 1)
        likely = self._model.back_projection(frame.image)
        ((u, v), (a, b), _), box = cv2.CamShift(likely, window, ends)
        if a <= 0 or b <= 0:
            return None
        self._box = (int(box[0]), int(box[1]), int(box[2]), int(box[3]))
        return float(u) + 0.5, float(v) + 0.5, float(a * b)
