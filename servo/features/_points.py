"""What feature sets of the four corners share."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from servo.types import Sight
from sim.types import Array


class OfCorners:
    """What feature sets of the four corners share."""

    names: tuple[str, ...]
    sole_dof: Mapping[str, str] = {}
    turns = slice(0)
    """Which of the features are angles; by default none."""

    def error(self, values: Array, goal: Array) -> Array:
        """Return e = s - s* (k,), angles wrapped to [-pi, pi)."""
        e = values - goal
        e[self.turns] = (e[self.turns] + np.pi) % (2 * np.pi) - np.pi
        return e

    def known(self, sight: Sight) -> NDArray[np.bool_]:
        """Return flags (k,): corners are known where angle and size are."""
        return np.full(len(self.names), sight.angle_known and sight.size_known)

    def scales(self, goal: Array) -> Array:
        """Return ones (k,): corners need no scale."""
        return np.ones(len(self.names))
