"""The corners and the pose together: what laws choose from that trust neither alone."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from servo.features.points import PointFeatures
from servo.features.pose import PoseFeatures
from servo.types import Sight
from sim.types import Array

POINTS = slice(0, 8)
TRANSLATION = slice(8, 11)
"""Where they are in the set."""


class PointsAndPose:
    """s = (x0, y0, ..., x3, y3, t, theta u): corners, normalised, and pose c*Mc."""

    sole_dof: Mapping[str, str] = {}

    def __init__(self) -> None:
        """Put both together."""
        self._parts = PointFeatures(), PoseFeatures("cdMc")
        points, pose = self._parts
        self.names = points.names + pose.names
        self.units = points.units + pose.units
        self.feed_forward = self.names
        self.noise = np.concatenate([points.noise, pose.noise])

    def values(self, sight: Sight) -> Array:
        """Return s (14,)."""
        return np.concatenate([part.values(sight) for part in self._parts])

    def matrix(self, sight: Sight) -> Array:
        """Return L (14, 6)."""
        return np.concatenate([part.matrix(sight) for part in self._parts])

    def error(self, values: Array, goal: Array) -> Array:
        """Return e = s - s* (14,)."""
        points, pose = self._parts
        place, turn = (part[POINTS.stop :] for part in (values, goal))
        return np.concatenate([points.error(values[POINTS], goal[POINTS]), pose.error(place, turn)])

    def known(self, sight: Sight) -> NDArray[np.bool_]:
        """Return fourteen flags."""
        return np.concatenate([part.known(sight) for part in self._parts])

    def scales(self, goal: Array) -> Array:
        """Return ones (14,)."""
        return np.ones(len(self.names))
