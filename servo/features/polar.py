"""Feature set of the four corners' polar coordinates: best for pure rotations (Iwatsuki, Okiyama
2005).
"""

from dataclasses import dataclass
from typing import final

import numpy as np

from servo.features._base import OfCorners
from servo.sight.point_rows import corner_rows, corners_of
from servo.types import Sight
from sim.types import Array

NOISE = (2e-4, 1e-3)
"""Standard deviations from frame to frame: rho at f = 600 px, theta [rad] at 0.2 from the middle.
"""


@dataclass(frozen=True, slots=True)
class Config:
    """The feature set `polar` has no settings."""

    def build(self, outline: Array) -> "PolarFeatures":
        """Return the feature set; the target's `outline`, corners (4, 3) in its frame [m], is not
        used.
        """
        return PolarFeatures()


@final
class PolarFeatures(OfCorners):
    """Feature set s = (rho0, theta0, ..., rho3, theta3) (8,): distance rho of each of the target's
    corners from the optical axis in normalised image coordinates, and direction theta of the corner
    as seen from the axis, from right towards down [rad].

    Iwatsuki and Okiyama 2005 (A new formulation of visual servoing based on cylindrical coordinate
    system, IEEE Transactions on Robotics 21). Ill-conditioned if a corner is near the optical axis.
    """

    names = tuple(f"{axis}{i}" for i in range(4) for axis in ("rho", "theta"))
    units = ("1", "rad") * 4
    angles = slice(1, None, 2)
    feed_forward = names
    noise = np.array(NOISE * 4)

    def values(self, sight: Sight) -> Array:
        """Return the features (8,) of the target as it is seen: for each corner its distance from
        the optical axis in normalised image coordinates, and its direction from there, -pi to pi,
        from right towards down [rad].
        """
        x, y = corners_of(sight).T
        return np.column_stack([np.hypot(x, y), np.arctan2(y, x)]).ravel()

    def matrix(self, sight: Sight) -> Array:
        """Return the interaction matrix L (8, 6) of the features for the target as it is seen:
        ds/dt = L v for a camera twist v (6,) in the camera frame [m/s, rad/s] and a target at rest.
        """
        (x, y) = corners_of(sight).T[..., None]
        (Lx, Ly) = corner_rows(sight)
        # Rows of x and y, rotated into the radial and the tangential direction of each corner.
        rho = np.hypot(x, y)
        along = (x * Lx + y * Ly) / rho
        around = (x * Ly - y * Lx) / rho**2
        return np.stack([along, around], axis=1).reshape(8, 6)
