"""Feature set of four corners, area and angle: area and angle control vz and wz, the corners the
other four components of the twist (Corke, Hutchinson 2001).
"""

from dataclasses import dataclass
from typing import final

import numpy as np

from servo.features._base import OfCorners
from servo.features.points import NOISE, PointFeatures
from servo.sight.point_rows import corner_rows, corners_of
from servo.types import Sight
from sim.types import Array, Camera

NOISES = (1e-3, 1e-3)
"""Standard deviations of ln sigma and of the angle [rad], from frame to frame."""
POINTS = slice(0, 8)
SIGMA, ANGLE = 8, 9
ALONG, ABOUT = 2, 5
"""vz and wz in a twist."""


@dataclass(frozen=True, slots=True)
class Config:
    """The feature set `partitioned` has no settings."""

    def build(self, outline: Array) -> "PartitionedFeatures":
        """Return the feature set; the target's `outline`, corners (4, 3) in its frame [m], is not
        used.
        """
        return PartitionedFeatures()


@final
class PartitionedFeatures(OfCorners):
    """Feature set s = (x0, y0, ..., x3, y3, ln sigma, theta) (10,): the target's four corners in
    normalised image coordinates, the logarithm of the square root sigma of the area that they
    enclose, and the angle theta of the side from the first corner to the second, from right towards
    down [rad].

    Corke and Hutchinson 2001 (A new partitioned approach to image-based visual servo control, IEEE
    Transactions on Robotics and Automation 17), equations 8 to 11, without the potential that
    repels the corners from the border. ln sigma controls the camera's velocity vz and theta its
    rate wz, each by its own entry of the interaction matrix. The corners control the other four
    velocities, after the effect of vz and wz on them.
    """

    names = (*PointFeatures.names, "sigma", "theta")
    units = (*PointFeatures.units, "1", "rad")
    angles = slice(ANGLE, None)
    feed_forward = names
    noise = np.array([NOISE] * 8 + [*NOISES])

    def values(self, sight: Sight) -> Array:
        """Return the features (10,) of the target as it is seen: x and y of each corner in
        normalised image coordinates, ln sigma of the area sigma^2 that they enclose, and the angle
        theta of the side from the first corner to the second, from right towards down [rad].
        """
        corners = corners_of(sight)
        (dx, dy) = corners[1] - corners[0]
        return np.array([*corners.ravel(), np.log(_area(corners)) / 2, np.arctan2(dy, dx)])

    def matrix(self, sight: Sight) -> Array:
        """Return the interaction matrix L (10, 6) of the features for the target as it is seen:
        ds/dt = L v for a camera twist v (6,) in the camera frame [m/s, rad/s] and a target at rest.
        """
        corners = corners_of(sight)
        Lx, Ly = corner_rows(sight)
        # The area changes with each corner by half the vector between its neighbours, turned.
        (nx, ny) = (np.roll(corners, -1, axis=0) - np.roll(corners, 1, axis=0)).T / 2
        wider = ny @ Lx - nx @ Ly
        (dx, dy) = corners[1] - corners[0]
        turned = (dx * (Ly[1] - Ly[0]) - dy * (Lx[1] - Lx[0])) / (dx * dx + dy * dy)
        points = np.stack([Lx, Ly], axis=1).reshape(8, 6)
        return np.vstack([points, wider / (2 * _area(corners)), turned])

    def inverse(self, L: Array, values: Array, camera: Camera) -> Array:
        """Return the matrix (6, 10) that replaces the pseudo-inverse L# in the law v = -lambda L#
        e, with the feature error e (10,) and the camera twist v (6,) in the camera frame [m/s,
        rad/s].

        Args:
            L: Interaction matrix (10, 6) of the features.
            values: Features (10,); not used.
            camera: Intrinsics; not used.
        """
        inverse = np.zeros(L.T.shape)
        # vz and wz first; the other four then answer the rest of the corners' error.
        inverse[ALONG, SIGMA] = 1 / L[SIGMA, ALONG]
        inverse[ABOUT, ANGLE] = 1 / L[ANGLE, ABOUT]
        others = [i for i in range(len(inverse)) if i not in (ALONG, ABOUT)]
        left = np.eye(8, len(L)) - L[POINTS] @ inverse
        inverse[others] = np.linalg.pinv(L[POINTS, others]) @ left
        return inverse


def _area(corners: Array) -> float:
    """Return the area inside the corners (4, 2), in the square of their unit: positive for corners
    that run clockwise in the image, as the target's do, negative otherwise.
    """
    (x, y) = corners.T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2
