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
    """Choices of the scale K of xn, yn and an: METRIC, the square root of the target's metric area,
    so that the features are in m; or PAPER, 1, so that they have no unit.

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
    """Feature set s = (xn, yn, an, theta) (4,) of the target's silhouette: an = K / sqrt(area),
    which is smaller for a larger silhouette; its centre in normalised image coordinates times an;
    and the direction theta of its long axis, from right towards down [rad].
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
        """Return the features (xn, yn, an, theta) (4,) of the target in a picture; theta in rad,
        the others in the unit of the scale K: m, or 1 with the scaling PAPER.
        """
        return of_moments(sight.moments, self.scale)

    def matrix(self, sight: Sight) -> Array:
        """Return the interaction matrix L (4, 6) with ds/dt = L v, for the camera twist v in the
        camera frame [m/s, rad/s]; its row of theta is zero for a round silhouette.
        """
        return interaction(sight.moments, sight.plane, self.scale)

    def error(self, values: Array, goal: Array) -> Array:
        """Return the error e = s - s* (4,). Moments do not distinguish the target's front from its
        back, so the error of theta is wrapped to half a turn, -pi/2 to pi/2.
        """
        e = values - goal
        e[3] = half_turn(e[3])
        return e

    def known(self, sight: Sight) -> NDArray[np.bool_]:
        """Return True (4,) for each feature that is measured: xn and yn always, an with the
        target's size, theta with its angle, if the silhouette is not nearly round.
        """
        angle = sight.angle_known and oriented(sight.moments)
        return np.array([True, True, sight.size_known, angle])

    def scales(self, goal: Array) -> Array:
        """Return the numbers (4,) by which an estimator's input is divided: an at the goal for xn,
        yn and an; 1 for theta.
        """
        an = goal[2]
        return np.array([an, an, an, 1.0])


def of_moments(m: Moments, scale: float) -> Array:
    """Return the features (xn, yn, an, theta) (4,) of a silhouette with moments m; theta in rad,
    the others in the unit of `scale`.

    Args:
        m: Moments in normalised image coordinates.
        scale: Scale K of xn, yn and an.
    """
    an = scale / sqrt(m.area)
    theta = atan2(2 * m.mu11, m.mu20 - m.mu02) / 2
    return np.array([an * m.xg, an * m.yg, an, theta])
