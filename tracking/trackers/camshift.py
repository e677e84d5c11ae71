"""Tracker for comparison: OpenCV's CamShift (Bradski 1998) on the back-projection of a hue
histogram.
"""

from dataclasses import dataclass
from typing import final

import cv2
import numpy as np

from sim.types import Array, Frame
from tracking.guests.boxes import box_of
from tracking.trackers._hue import ENDS, HueTracker
from tracking.types import SET_BY_START, Region, State, Trait

SMALLEST_BOX = 4
"""Least side of the window in which CamShift begins [px]: a smaller window is enlarged to it."""


@dataclass(frozen=True, slots=True)
class Config:
    """The tracker `camshift` has no settings."""

    traits = frozenset({Trait.COLOUR})

    def build(self, rng: np.random.Generator) -> "Camshift":
        """Return a new tracker; `rng` is not used."""
        return Camshift()


@final
class Camshift(HueTracker):
    """Tracker by OpenCV's CamShift: centre and size are those of an ellipse fitted to the pixels
    with the target's hues, the angle keeps its first value, and the distance of the hue histogram
    there decides the status.
    """

    follows = (False, True)
    _box: tuple[int, int, int, int] = SET_BY_START

    def start(self, frame: Frame, region: Region, state: State) -> None:
        """Learn the target's hue histogram from the first frame, in which it is the rectangle
        `region` [px] at `state`, and fit a first ellipse: the size in later frames is relative to
        its area (to the region's, if CamShift finds nothing).

        Raises:
            ValueError: `check_region` refuses the picture or the region: a side of the region is
                shorter than 4 px, for instance, or most of it is outside the picture.
        """
        super().start(frame, region, state)
        self._box = box_of(region, state, frame.image)
        # CamShift's ellipse is not the region: only the ratio of its areas is used.
        fitted = self._fit(frame)
        self._first = region.width * region.height if fitted is None else fitted[2], state.scale

    def _found(self, frame: Frame, ego: Array | None) -> State:
        """Return the state at the fitted ellipse; the last state if CamShift finds nothing. Only
        the position (2,) [px] of `ego` is used.
        """
        if ego is not None:
            x, y, width, height = self._box
            self._box = (x + round(ego[0]), y + round(ego[1]), width, height)
        if (fitted := self._fit(frame)) is None:
            return self._state
        x, y, area = fitted
        first, scale = self._first
        # The angle of an ellipse has no front or back, and jumps for round targets: it is not used.
        return State(x, y, self._state.theta, scale * float(np.sqrt(area / first)))

    def _fit(self, frame: Frame) -> tuple[float, float, float] | None:
        """Return x and y of the centre [px] and the product of the axes [px^2] of the ellipse that
        CamShift finds, and begin there in the next frame; None where it finds nothing.
        """
        height, width = frame.image.shape[:2]
        x, y, w, h = self._box
        w = min(max(w, SMALLEST_BOX), width)
        h = min(max(h, SMALLEST_BOX), height)
        window = (min(max(x, 0), width - w), min(max(y, 0), height - h), w, h)
        likely = self._model.back_projection(frame.image)
        ((u, v), (a, b), _), box = cv2.CamShift(likely, window, ENDS)
        if a <= 0 or b <= 0:
            return None
        self._box = (int(box[0]), int(box[1]), int(box[2]), int(box[3]))
        return float(u) + 0.5, float(v) + 0.5, float(a * b)
