"""Tracker for comparison: OpenCV's meanShift on the back-projection of a hue histogram."""

from dataclasses import dataclass
from typing import final

import cv2
import numpy as np

from sim.types import Array, Frame
from tracking.guests.boxes import box_of
from tracking.trackers._hue import ENDS, HueTracker
from tracking.types import State, Trait


@dataclass(frozen=True, slots=True)
class Config:
    """The tracker `cv_mean_shift` has no settings."""

    traits = frozenset({Trait.COLOUR})

    def build(self, rng: np.random.Generator) -> "CvMeanShift":
        """Return a new tracker; `rng` is not used."""
        return CvMeanShift()


@final
class CvMeanShift(HueTracker):
    """Tracker by OpenCV's meanShift: an upright box of fixed size moves to where most pixels have
    the target's hues; the distance of the hue histogram there decides the status. Angle and size
    keep their first values.
    """

    def _found(self, frame: Frame, ego: Array | None) -> State:
        box = box_of(self._region, self._state.moved(ego), frame.image)
        _, box = cv2.meanShift(self._model.back_projection(frame.image), box, ENDS)
        x, y, width, height = (int(v) for v in box)
        return State(x + width / 2, y + height / 2, self._state.theta, self._state.scale)
