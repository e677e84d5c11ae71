"""Base classes of feature sets, with the methods that most of them share."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from servo.types import Sight
from sim.types import Array


class Features:
    """Base class of feature sets whose features are measured in every picture in which the target
    is seen; their scales are 1.
    """

    names: tuple[str, ...]
    sole_dof: Mapping[str, str] = {}
    angles = slice(0)
    """The features that are angles; by default none."""

    def error(self, values: Array, goal: Array) -> Array:
        """Return the error e = s - s* (k,) from the features s and those s* at the goal; the
        features that `angles` selects are wrapped to [-pi, pi).
        """
        e = values - goal
        e[self.angles] = (e[self.angles] + np.pi) % (2 * np.pi) - np.pi
        return e

    def known(self, sight: Sight) -> NDArray[np.bool_]:
        """Return True (k,) for each feature that is measured: here for all, whatever the
        sight is.
        """
        return np.full(len(self.names), True)

    def scales(self, goal: Array) -> Array:
        """Return the numbers (k,) by which an estimator's input is divided: here ones."""
        return np.ones(len(self.names))


class OfCorners(Features):
    """Base class of features that are computed from the target's four corners; they are measured in
    a picture if both angle and size of the target are.
    """

    def known(self, sight: Sight) -> NDArray[np.bool_]:
        """Return True (k,) for all features if the sight measures angle and size, else False
        (k,).
        """
        return np.full(len(self.names), sight.angle_known and sight.size_known)
