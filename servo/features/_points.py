"""What feature sets of the four corners share."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from servo.types import Sight
from sim.types import Array


class OfCorners:
    """What feature sets of the four corners share."""

    sole_dof: Mapping[str, str] = {}

    def known(self, sight: Sight) -> NDArray[np.bool_]:
        """Corners are known where angle and size are."""
        return np.full(8, sight.angle_known and sight.size_known)

    def scales(self, goal: Array) -> Array:
        """1."""
        return np.ones(8)


def whole_turn(angles: Array) -> Array:
    """Angles [rad] wrapped to [-pi, pi)."""
    return (angles + np.pi) % (2 * np.pi) - np.pi
