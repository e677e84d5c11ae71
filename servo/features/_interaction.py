"""Interaction matrix L of the moment features, with ds/dt = L v for a camera twist v and a target
at rest.

After Tahri and Chaumette 2005 and Teuliere, Marchand and Eck 2009, section VI, written for any
target plane 1/Z = A x + B y + C; a plane parallel to the image has A = B = 0. The formulas use the
area a, the centroid (xg, yg), the central moments mu_pq, the scale K of the features (moments.py),
and

    n_pq = 4 mu_pq / a    e11 = n11 - xg yg / 2    e12 = n20 - xg^2 / 2    e21 = n02 - yg^2 / 2

ViSP 3.5's first element is wrong for tilted planes (a factor 1/2 is missing); ours agrees with
finite differences. Twist order: vx, vy, vz, wx, wy, wz.
"""

from dataclasses import dataclass
from math import hypot, sqrt

import numpy as np

from servo.types import Moments, Plane
from sim.types import Array

LEAST_ELONGATION = 1.1
"""Ratio of the long to the short axis from which the orientation is servoed; its row of L grows
without limit as the shape becomes round."""
ROUND = 1e-9
"""Below this difference of the principal moments, over their sum, a shape has no orientation."""
InteractionRow = tuple[float, float, float, float, float, float]


@dataclass(frozen=True, slots=True)
class Spread:
    """Numbers e11, e12, e21 and k of a silhouette that the rows of the interaction matrix share:
    second moments over the area, and the inverse depth.
    """

    e11: float
    e12: float
    e21: float
    k: float
    """Inverse depth of the plane at the centroid."""

    @staticmethod
    def of(m: Moments, plane: Plane) -> "Spread":
        """Return the spread of a silhouette with moments m (normalised image coordinates) in a
        plane of the camera frame.
        """
        n20 = 4 * m.mu20 / m.area
        n11 = 4 * m.mu11 / m.area
        n02 = 4 * m.mu02 / m.area
        return Spread(
            e11=n11 - m.xg * m.yg / 2,
            e12=n20 - m.xg**2 / 2,
            e21=n02 - m.yg**2 / 2,
            k=plane.A * m.xg + plane.B * m.yg + plane.C,
        )


def row_xn(m: Moments, plane: Plane, an: float, s: Spread) -> InteractionRow:
    """Return the row (6,) of xn = an xg in the interaction matrix."""
    A = plane.A
    B = plane.B
    xn = an * m.xg
    yn = an * m.yg
    vx = -an * (s.k - A * m.xg / 2)
    vy = B * xn / 2
    vz = an * (A * s.e12 + B * s.e11)
    return vx, vy, vz, an * s.e11, -an * (1 + s.e12), yn


def row_yn(m: Moments, plane: Plane, an: float, s: Spread) -> InteractionRow:
    """Return the row (6,) of yn = an yg in the interaction matrix."""
    A = plane.A
    B = plane.B
    xn = an * m.xg
    yn = an * m.yg
    vx = A * yn / 2
    vy = -an * (s.k - B * m.yg / 2)
    vz = an * (A * s.e11 + B * s.e21)
    return vx, vy, vz, an * (1 + s.e21), -an * s.e11, -xn


def row_an(m: Moments, plane: Plane, an: float, s: Spread) -> InteractionRow:
    """Return the row (6,) of an = K / sqrt(a) in the interaction matrix, with the area a."""
    A = plane.A
    B = plane.B
    C = plane.C
    k = s.k
    vz = -an * (3 * k - C) / 2
    return A * an / 2, B * an / 2, vz, -1.5 * an * m.yg, 1.5 * an * m.xg, 0.0


def row_theta(m: Moments, plane: Plane) -> InteractionRow:
    """Return the row (6,) of the angle theta = atan2(2 mu11, mu20 - mu02) / 2 in the interaction
    matrix.

    Raises:
        ValueError: The shape is round, so it has no orientation.
    """
    d = m.mu20 - m.mu02
    total = m.mu20 + m.mu02
    D = d**2 + 4 * m.mu11**2
    root = sqrt(D)
    if root <= ROUND * total:
        raise ValueError(
            "the target's shape has equal principal moments, so its angle is not defined: choose a "
            "longer target, or features without the angle"
        )
    q = total / root
    c = d / root
    s = 2 * m.mu11 / root
    A = plane.A
    B = plane.B
    xg = m.xg
    yg = m.yg
    wx = 5 * (m.mu12 * d + m.mu11 * (m.mu03 - m.mu21)) / D + (-xg * (1 - q * c) + yg * q * s) / 2
    wy = 5 * (-m.mu21 * d + m.mu11 * (m.mu30 - m.mu12)) / D + (xg * q * s - yg * (1 + q * c)) / 2
    vx = (A * q * s + B * (1 - q * c)) / 2
    vy = -(A * (1 + q * c) + B * q * s) / 2
    return vx, vy, B * wx - A * wy, wx, wy, -1.0


def oriented(m: Moments, elongation: float = LEAST_ELONGATION) -> bool:
    """Return whether the long axis of a silhouette is more than `elongation` times its short one,
    so that its angle is defined well.
    """
    spread = hypot(m.mu20 - m.mu02, 2 * m.mu11)
    total = m.mu20 + m.mu02
    return total + spread > elongation**2 * (total - spread)


def interaction(m: Moments, plane: Plane, scale: float) -> Array:
    """Return the interaction matrix L (4, 6) of s = (xn, yn, an, theta), with an = scale /
    sqrt(area).

    The row of theta is zero for a round shape, whose angle is not defined.

    Args:
        m: Moments of the silhouette in normalised image coordinates.
        plane: Plane of the target in the camera frame.
        scale: Scale K of xn, yn and an.
    """
    an = scale / sqrt(m.area)
    theta = row_theta(m, plane) if oriented(m, 1 + ROUND) else (0.0,) * 6
    seen = m, plane, an, Spread.of(m, plane)
    return np.array([row_xn(*seen), row_yn(*seen), row_an(*seen), theta])
