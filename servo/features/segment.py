"""Feature set of the target's two sides along its nose: middle, length and angle of each (Espiau,
Chaumette, Rives 1992).
"""

from dataclasses import dataclass
from typing import final

import numpy as np

from servo.features._base import OfCorners
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
    """Settings of the feature set `segment`: with `normalised`, xc/l, yc/l and 1/l replace the
    middle (xc, yc) and the length l of each side.
    """

    normalised: bool = False
    """Whether xc/l, yc/l and 1/l replace xc, yc and l: the interaction matrix is then simpler
    for a target that faces the camera."""

    def build(self, outline: Array) -> "SegmentFeatures":
        """Return the feature set; the target's `outline`, corners (4, 3) in its frame [m], is not
        used.
        """
        return SegmentFeatures(self.normalised)


@final
class SegmentFeatures(OfCorners):
    """Feature set (8,): s = (xc, yc, l, alpha) for each of the two sides of the target's rectangle
    along its nose: the middle and length in normalised image coordinates, and the angle [rad]. With
    `normalised` they are (xc/l, yc/l, 1/l, alpha).

    Espiau, Chaumette and Rives 1992 (A new approach to visual servoing in robotics, IEEE
    Transactions on Robotics and Automation 8); alpha is the direction from the front corner to the
    rear one, from right towards down, as in ViSP.
    """

    units = ("1", "1", "1", "rad") * 2
    angles = slice(3, None, 4)

    def __init__(self, normalised: bool) -> None:
        self._normalised = normalised
        kinds = ("xn", "yn", "ln", "alpha") if normalised else ("x", "y", "length", "alpha")
        self.names = tuple(f"{kind}{i}" for i in range(2) for kind in kinds)
        self.feed_forward = tuple(self.names[i] for i in (0, 1, 4, 5))
        self.noise = np.array(NOISE * 2) * ([10, 10, 10, 1] * 2 if normalised else 1.0)

    def values(self, sight: Sight) -> Array:
        """Return the features (8,) of the target as it is seen: middle (xc, yc) and length l in
        normalised image coordinates, and angle alpha [rad], of the side from the first corner to
        the second, then those of the side from the fourth to the third. With the setting
        `normalised`, (xc/l, yc/l, 1/l) replace (xc, yc, l).
        """
        middle, back, length = self._segments(sight)
        alpha = np.arctan2(back[:, 1], back[:, 0])
        if self._normalised:
            return np.column_stack([middle / length[:, None], 1 / length, alpha]).ravel()
        return np.column_stack([middle, length, alpha]).ravel()

    def matrix(self, sight: Sight) -> Array:
        """Return the interaction matrix L (8, 6) of the features for the target as it is seen:
        ds/dt = L v for a camera twist v (6,) in the camera frame [m/s, rad/s] and a target at rest.
        """
        middle, back, length = self._segments(sight)
        Lx, Ly = corner_rows(sight)
        xc, yc = ((L[FROM] + L[TO]) / 2 for L in (Lx, Ly))
        dx, dy = (L[FROM] - L[TO] for L in (Lx, Ly))
        long = length[:, None]
        u = back[:, :1] / long
        v = back[:, 1:] / long
        longer = u * dx + v * dy
        turned = (u * dy - v * dx) / long
        if self._normalised:
            x = middle[:, :1]
            y = middle[:, 1:]
            xc, yc = ((c - p * longer / long) / long for c, p in ((xc, x), (yc, y)))
            longer = -longer / long**2
        return np.stack([xc, yc, longer, turned], axis=1).reshape(8, 6)

    def _segments(self, sight: Sight) -> tuple[Array, Array, Array]:
        """Return three arrays of the two segments, in normalised image coordinates: middles (2, 2),
        vectors from end to start (2, 2), and lengths (2,).
        """
        corners = corners_of(sight)
        start = corners[FROM]
        end = corners[TO]
        back = start - end
        return (start + end) / 2, back, np.hypot(back[:, 0], back[:, 1])
