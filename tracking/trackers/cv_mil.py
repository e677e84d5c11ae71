"""Tracker for comparison: OpenCV's TrackerMIL (Babenko, Yang, Belongie 2009).

It has no confidence of its own; distance and status come from a hue histogram of its box.
"""

from dataclasses import dataclass
from typing import final

import numpy as np

from sim.channels import Channel
from sim.types import Array, Frame
from tracking.guests.boxes import box_of
from tracking.guests.cv2_tracker import Cv2Tracker
from tracking.trackers._hue import HueTracker
from tracking.types import SET_BY_START, Region, State, Trait

SEED_BITS = 31
"""Bits of the seeds that OpenCV takes."""


@dataclass(frozen=True, slots=True)
class Config:
    """The tracker `cv_mil` has no settings."""

    needs = frozenset({Channel.PICTURE})
    traits = frozenset({Trait.TEXTURE})

    def build(self, rng: np.random.Generator) -> "CvMil":
        """Return a new tracker. A seed for OpenCV's own random numbers is drawn from `rng`."""
        return CvMil(int(rng.integers(1 << SEED_BITS)))


@final
class CvMil(HueTracker):
    """Tracker by OpenCV's TrackerMIL, an online boosted classifier with the random seed `seed`: it
    finds an upright box of fixed size, and the distance of the hue histogram there decides the
    status. Angle and size keep their first values.
    """

    _mil: Cv2Tracker = SET_BY_START

    def __init__(self, seed: int) -> None:
        self._seed = seed

    def start(self, frame: Frame, region: Region, state: State) -> None:
        """Learn the target's hue histogram and train OpenCV's classifier on the first frame, in
        which the target is the rectangle `region` [px] at `state`.

        Raises:
            ValueError: `check_region` refuses the picture or the region (most of it is outside the
                picture, for instance), or the region is too small for OpenCV's tracker.
        """
        super().start(frame, region, state)
        self._mil = Cv2Tracker("MIL", (), self._seed)
        self._mil.init(np.ascontiguousarray(frame.image), box_of(region, state, frame.image))

    def _found(self, frame: Frame, ego: Array | None) -> State:
        """Return the state at the box that OpenCV finds around its last one, or the last state if
        it finds none; the camera's motion is not used.
        """
        found, box = self._mil.update(np.ascontiguousarray(frame.image))
        if not found:
            return self._state
        x, y, width, height = box
        return State(x + width / 2, y + height / 2, self._state.theta, self._state.scale)
