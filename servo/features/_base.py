"""Members that feature sets share."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from servo.types import Sight
from sim.types import Array


class Features:
    """Base of feature sets whose features are measured in each sight, and need no scales."""

    names: tuple[str, ...]
    sole_dof: Mapping[str, str] = {}
    angles = slice(0)
    """The features that are angles; by default none."""

    def error(self, values: Array, goal: Array) -> Array:
        """Return the error e = s - s* (k,), angles wrapped to [-pi, pi)."""
        e = values - goal
        e[self.angles] = (e[self.angles] + np.pi) % (2 * np.pi) - np.pi
        return e

    def known(self, sight: Sight) -> NDArray[np.bool_]:
        """Return True (k,): each feature is measured in every sight."""
        return np.full(len(self.names), True)

    def scales(self, goal: Array) -> Array:
        """Return the divisors (k,) of the features: ones, as they need no scales."""
        return np.ones(len(self.names))


class OfCorners(Features):
    """Features of the four corners, which are measured if angle and size of the target are."""

    def known(self, sight: Sight) -> NDArray[np.bool_]:
        """Return True (k,) if the sight measures angle and size, else False (k,)."""
        return np.full(len(self.names), sight.angle_known and sight.size_known)
