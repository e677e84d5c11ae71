"""Feature set of the four corners' image coordinates: classic image-based servoing (Chaumette,
Hutchinson 2006).
"""

from dataclasses import dataclass
from typing import final

import numpy as np

from servo.features._base import OfCorners
from servo.sight.point_rows import corner_rows, corners_of
from servo.types import Sight
from sim.types import Array

NOISE = 2e-4
"""Standard deviation of a corner from frame to frame: 0.1 px at f = 600 px."""


@dataclass(frozen=True, slots=True)
class Config:
    """The feature set `points` has no settings."""

    def build(self, outline: Array) -> "PointFeatures":
        """Return the feature set; the target's `outline`, corners (4, 3) in its frame [m], is not
        used.
        """
        return PointFeatures()


@final
class PointFeatures(OfCorners):
    """Feature set s = (x0, y0, ..., x3, y3) (8,): the target's four corners in normalised image
    coordinates.

    Chaumette and Hutchinson 2006 (Visual servo control, part I: basic approaches, IEEE Robotics and
    Automation Magazine 13). To correct a rotation about the optical axis, the camera also retreats
    if the law uses the interaction matrix of the present picture (`matrix = "current"`), and
    approaches with that of the goal ("desired"); it fails to correct half a turn.
    """

    names = tuple(f"{axis}{i}" for i in range(4) for axis in "xy")
    units = ("1",) * 8
    feed_forward = names
    noise = np.full(8, NOISE)

    def values(self, sight: Sight) -> Array:
        """Return a new array of the features (8,) of the target as it is seen: x and y of each
        corner in normalised image coordinates.
        """
        return corners_of(sight).flatten()  # a copy, so that callers may change it in place

    def matrix(self, sight: Sight) -> Array:
        """Return the interaction matrix L (8, 6) of the features for the target as it is seen:
        ds/dt = L v for a camera twist v (6,) in the camera frame [m/s, rad/s] and a target at rest.
        Each corner has its own depth in the target's plane.
        """
        return np.stack(corner_rows(sight), axis=1).reshape(8, 6)
