"""Middle, length and angle of the two long sides (Espiau, Chaumette, Rives 1992)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from servo.features._points import OfCorners
from servo.sight.point_rows import corner_rows, corners_of
from servo.types import Sight
from sim.types import Array

FROM = [0, 3]
TO = [1, 2]
"""Corners at which the two sides begin and end, along the nose."""
NOISE = (2e-4, 2e-4, 3e-4, 1e-3)
"""Standard deviations from frame to frame: x, y and length at f = 600 px, the angle [rad]."""


@dataclass(frozen=True, slots=True)
class Config:
    """Nothing to set."""

    def build(self, outline: Array) -> SegmentFeatures:
        """Return the features of any target."""
        return SegmentFeatures()


@final
class SegmentFeatures(OfCorners):
    """s = (xc, yc, l, alpha) of each of two segments.

    Espiau, Chaumette and Rives 1992 (A new approach to visual servoing in robotics, IEEE
    Transactions on Robotics and Automation 8); alpha points from the segment's end to its start,
    as in ViSP.
    """

    names = tuple(f"{part}{i}" for i in range(2) for part in ("x", "y", "length", "alpha"))
    units = ("1", "1", "1", "rad") * 2
    turns = slice(3, None, 4)
    feed_forward = ("x0", "y0", "x1", "y1")
    noise = np.array(NOISE * 2)

    def values(self, sight: Sight) -> Array:
        """Return s (8,)."""
        middle, back, length = self._segments(sight)
        alpha = np.arctan2(back[:, 1], back[:, 0])
        return np.column_stack([middle, length, alpha]).ravel()

    def matrix(self, sight: Sight) -> Array:
        """Return L (8, 6), from those of the corners at the segments' ends."""
        _, back, length = self._segments(sight)
        Lx, Ly = corner_rows(sight)
        xc, yc = ((L[FROM] + L[TO]) / 2 for L in (Lx, Ly))
        dx, dy = (L[FROM] - L[TO] for L in (Lx, Ly))
        long = length[:, None]
        u = back[:, :1] / long
        v = back[:, 1:] / long
        longer = u * dx + v * dy
        turned = (u * dy - v * dx) / long
        return np.stack([xc, yc, longer, turned], axis=1).reshape(8, 6)

    def _segments(self, sight: Sight) -> tuple[Array, Array, Array]:
        """Return the middles (2, 2), vectors from end to start (2, 2), and lengths (2,)."""
        corners = corners_of(sight)
        start = corners[FROM]
        end = corners[TO]
        back = start - end
        return (start + end) / 2, back, np.hypot(back[:, 0], back[:, 1])
