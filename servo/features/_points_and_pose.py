"""Base class of the feature sets that combine the target's corners with its pose."""

import numpy as np
from numpy.typing import NDArray

from servo.features._base import Features
from servo.features.points import PointFeatures
from servo.features.pose import PoseFeatures
from servo.types import Sight
from sim.types import Array

POINTS = slice(0, 8)
TRANSLATION = slice(8, 11)
"""Places of the corners' coordinates and of the translation in the set."""


class PointsAndPose(Features):
    """Base class with the features s = (x0, y0, ..., x3, y3, t, theta u) (14,): the corners in
    normalised image coordinates, and translation [m] and rotation vector [rad] of the pose c*Mc, of
    the camera in the frame of the desired camera.
    """

    def __init__(self) -> None:
        """Join the names, units and noises of the feature sets `points` and `pose`."""
        self._parts = PointFeatures(), PoseFeatures("cdMc")
        points, pose = self._parts
        self.names = points.names + pose.names
        self.units = points.units + pose.units
        self.feed_forward = self.names
        self.noise = np.concatenate([points.noise, pose.noise])

    def values(self, sight: Sight) -> Array:
        """Return the features (14,) of the target in a picture: eight corner coordinates, three of
        t [m], three of theta u [rad].
        """
        return np.concatenate([part.values(sight) for part in self._parts])

    def matrix(self, sight: Sight) -> Array:
        """Return the interaction matrix L (14, 6) of the features: ds/dt = L v for a camera twist v
        (6,) in the camera frame [m/s, rad/s] and a target at rest.
        """
        return np.concatenate([part.matrix(sight) for part in self._parts])

    def error(self, values: Array, goal: Array) -> Array:
        """Return the error e = s - s* (14,); of the rotation vectors of one rotation, the one
        nearest to the goal's counts.
        """
        points, pose = self._parts
        place, turn = (part[POINTS.stop :] for part in (values, goal))
        return np.concatenate([points.error(values[POINTS], goal[POINTS]), pose.error(place, turn)])

    def known(self, sight: Sight) -> NDArray[np.bool_]:
        """Return True (14,) for each feature that the sight measures."""
        return np.concatenate([part.known(sight) for part in self._parts])
