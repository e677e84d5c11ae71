"""Base class of the feature sets that combine the target's corners with its pose."""

import numpy as np
from numpy.typing import NDArray

from servo.features import points
from servo.features._base import Features
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

    corners = points.Config()
    pose = PoseFeatures("cdMc")
    names = corners.names + pose.names
    units = corners.units + pose.units
    feed_forward = names
    noise = np.concatenate([corners.noise, pose.noise])

    def values(self, sight: Sight) -> Array:
        """Return the features (14,) of the target in a picture: eight corner coordinates, three of
        t [m], three of theta u [rad].
        """
        return np.concatenate([self.corners.values(sight), self.pose.values(sight)])

    def matrix(self, sight: Sight) -> Array:
        """Return the interaction matrix L (14, 6)."""
        return np.concatenate([self.corners.matrix(sight), self.pose.matrix(sight)])

    def error(self, values: Array, goal: Array) -> Array:
        """Return the error e = s - s* (14,); of the rotation vectors of one rotation, the one
        nearest to the goal's counts.
        """
        in_picture = self.corners.error(values[POINTS], goal[POINTS])
        in_space = self.pose.error(values[POINTS.stop :], goal[POINTS.stop :])
        return np.concatenate([in_picture, in_space])

    def known(self, sight: Sight) -> NDArray[np.bool_]:
        """Return True (14,) for each feature that the sight measures."""
        return np.concatenate([self.corners.known(sight), self.pose.known(sight)])
