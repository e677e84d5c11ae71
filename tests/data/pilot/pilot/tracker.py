"""A tracker of red things, and one with the methods that OpenCV's trackers have."""

from dataclasses import dataclass

import cv2
import numpy as np

from servo import Estimate, State, Status
from tracking.types import check_region, unknown_covariance


@dataclass(frozen=True, slots=True)
class Config:
    """Follows whatever is red."""

    least: int = 90
    """How much redder than green a pixel must be [grey levels]."""
    reach: float = 40.0
    """How far from its last place the target is searched for [px]."""

    def build(self, rng):
        return Red(self)


class Red:
    def __init__(self, config):
        self._config = config

    def start(self, frame, region, state):
        check_region(frame, region, state)
        self._state = state

    def update(self, frame, ego=None):
        red, green, _ = np.moveaxis(frame.image.astype(int), -1, 0)
        rows, columns = np.nonzero(red > green + self._config.least)
        near = np.hypot(columns - self._state.x, rows - self._state.y) < self._config.reach
        rows, columns = rows[near], columns[near]
        seen = len(rows) >= 20
        if seen:
            first = self._state
            x, y = float(columns.mean() + 0.5), float(rows.mean() + 0.5)
            self._state = State(x, y, first.theta, first.scale)
        status = Status.LOCKED if seen else Status.LOST
        distance = 0.0 if seen else 1.0
        return Estimate(self._state, unknown_covariance(), distance, status, follows=(False, False))


class InitUpdate:
    """Template matching, as a class of OpenCV's convention."""

    def init(self, image, rect):
        x, y, w, h = rect
        self._template, self._rect = image[y : y + h, x : x + w].copy(), rect

    def update(self, image):
        found = cv2.matchTemplate(image, self._template, cv2.TM_SQDIFF)
        _, _, (x, y), _ = cv2.minMaxLoc(found)
        self._rect = (x, y, *self._rect[2:])
        return True, self._rect
