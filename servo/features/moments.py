"""Feature set of image moments: centre, size and angle of the silhouette, xn, yn, an, theta (Tahri,
Chaumette 2005).

    an = K / sqrt(a)    xn = an xg    yn = an yg    theta = atan2(2 mu11, mu20 - mu02) / 2

with the area a, the centroid (xg, yg) and the central moments mu of the silhouette in normalised
image coordinates (Tahri and Chaumette 2005; Teuliere, Marchand and Eck 2009, section VI). The scale
K is a setting (`Scaling`).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from math import atan2, sqrt
from typing import final

import numpy as np
from numpy.typing import NDArray

from servo.features._interaction import interaction, oriented
from servo.types import Moments, Sight
from sim.geometry import half_turn
from sim.outline import Outline
from sim.types import Array

NOISE = np.array([1e-4, 1e-4, 7e-4, 1e-3])
"""Standard deviations from frame to frame, relative to the goal's an, as `pf_ssd` measures them:
0.03 px at f = 290 px, 0.07 % of size, 0.06 degrees. Estimates depend on ratios only; innovations
over their variance, and what is decided by them, on these too."""


class Scaling(Enum):
    """Choices of the scale K of the features xn, yn and an: METRIC, the square root of the target's
    metric area, so that these are in m; or PAPER, 1, so that they have no unit.

    The camera's motion is the same with both; thresholds, adaptive gains and plots differ.
    """

    METRIC = "metric"
    """K = sqrt(metric area), which is Z* sqrt(a*) (Tahri and Chaumette 2005): an is the depth
    [m]."""
    PAPER = "paper"
    """K = 1 (Teuliere, Marchand and Eck 2009): an is 1 over the square root of the normalised
    area."""


@dataclass(frozen=True, slots=True)
class Config:
    """Settings of the feature set `moments`: the scale K of xn, yn and an, the square root of the
    target's metric area [m] (metric) or 1 (paper).
    """

    scaling: Scaling = Scaling.METRIC
    """Unit of xn, yn and an: "metric" (an is the depth in m) or "paper" (an is 1 / sqrt(area))."""

    def build(self, outline: Array) -> "MomentFeatures":
        """Return the feature set for a target whose reference rectangle has the corners `outline`
        (4, 3), in the target's frame [m]; only their area is used.
        """
        return MomentFeatures(self.scaling, sqrt(Outline(outline).area))


@final
class MomentFeatures:
    """Feature set s = (xn, yn, an, theta) (4,) of the target's silhouette with the image area a: an
    = K / sqrt(a); xn = an xg and yn = an yg, with the centroid (xg, yg) in normalised image
    coordinates; and the direction theta of the long axis, from right towards down [rad]. The scale
    K is the square root of the target's metric area [m], or 1.
    """

    names = ("xn", "yn", "an", "theta")
    feed_forward = ("xn", "yn")
    sole_dof: Mapping[str, str] = {"an": "vz", "theta": "wz"}

    def __init__(self, scaling: Scaling, root_area: float) -> None:
        """Set the scale K: `root_area` for the scaling METRIC, 1 for PAPER.

        Args:
            scaling: Choice of the scale K.
            root_area: Square root of the area of the target's reference rectangle [m].
        """
        metric = scaling is Scaling.METRIC
        self.scale = root_area if metric else 1.0
        """The scale K."""
        self.units = (*(("m" if metric else "1",) * 3), "rad")
        self.noise = NOISE

    def values(self, sight: Sight) -> Array:
        """Return the features (xn, yn, an, theta) (4,) from the target's moments; theta is in rad,
        the others are in the unit of the scale K: m with the scaling METRIC, none with PAPER.
        """
        return of_moments(sight.moments, self.scale)

    def matrix(self, sight: Sight) -> Array:
        """Return the interaction matrix L (4, 6) of (xn, yn, an, theta) from the target's moments
        and plane: ds/dt = L v for a camera twist v (6,) in the camera frame [m/s, rad/s] and a
        target at rest. Its row of theta is zero for a round silhouette, which has no direction.
        """
        return interaction(sight.moments, sight.plane, self.scale)

    def error(self, values: Array, goal: Array) -> Array:
        """Return the error e = s - s* (4,) of the features s (`values`) against those at the goal,
        in their units. Moments do not distinguish the target's front from its back, so the error of
        theta is wrapped to half a turn, (-pi/2, pi/2].
        """
        e = values - goal
        e[3] = half_turn(e[3])
        return e

    def known(self, sight: Sight) -> NDArray[np.bool_]:
        """Return a flag (4,) for each of xn, yn, an and theta, True if it is measured: xn and yn
        always, an if the target's size is, theta if its angle is and the silhouette's long axis is
        more than 1.1 times its short one.
        """
        angle = sight.angle_known and oriented(sight.moments)
        return np.array([True, True, sight.size_known, angle])

    def scales(self, goal: Array) -> Array:
        """Return the divisors (4,) of the features' errors for an estimator: the feature an at the
        goal for xn, yn and an; 1 for theta.

        Args:
            goal: The features (4,) at the goal.
        """
        an = goal[2]
        return np.array([an, an, an, 1.0])


def of_moments(m: Moments, scale: float) -> Array:
    """Return the features (xn, yn, an, theta) (4,) of a silhouette: an = K / sqrt(area), an times
    the centroid, and the direction of the long axis, from right towards down [rad]. The first three
    are in the unit of `scale`.

    Args:
        m: Moments of the silhouette in normalised image coordinates.
        scale: The scale K: the square root of the target's metric area [m], or 1.
    """
    an = scale / sqrt(m.area)
    theta = atan2(2 * m.mu11, m.mu20 - m.mu02) / 2
    return np.array([an * m.xg, an * m.yg, an, theta])
