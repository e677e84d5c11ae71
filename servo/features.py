"""Between tracker states and features: s = (xn, yn, an, theta), with an = K / sqrt(a), xn = an xg,
yn = an yg.

Two scalings are in use. The paper (Teuliere, Marchand, Eck) has K = 1, so an is about 1 /
sqrt(area); Tahri and Chaumette 2005 have K = Z* sqrt(a*), which is the square root S of the metric
area: an is then the depth in metres. The control is the same; thresholds, gains that adapt,
filters' constants and plots are not.
"""

from __future__ import annotations

from enum import Enum
from math import atan2, sqrt

import numpy as np

from servo import moments
from servo.types import Moments, Plane
from sim.types import Array, Camera, Pose
from tracking.types import Region, State

EDGE_ON = 0.05
"""A plane that is seen at a smaller angle [rad] has no depth to tell from its size."""


class Scaling(Enum):
    """The unit of an, xn and yn."""

    METRIC = "metric"
    """K = sqrt(metric area): an is the depth [m]."""
    PAPER = "paper"
    """K = 1: an is 1 over the square root of the normalised area."""

    @property
    def unit(self) -> str:
        """Unit of xn, yn and an."""
        return "m" if self is Scaling.METRIC else "1"

    def factor(self, root_area: float) -> float:
        """K, for a target whose metric area has this square root [m]."""
        return root_area if self is Scaling.METRIC else 1.0


def of_moments(m: Moments, scale: float) -> Array:
    """The features (4,) of a silhouette; scale is K."""
    an = scale / sqrt(m.area)
    theta = atan2(2 * m.mu11, m.mu20 - m.mu02) / 2
    return np.array([an * m.xg, an * m.yg, an, theta])


def moments_of(corners: Array, camera: Camera) -> Moments:
    """The moments of a polygon (n, 2) [px], in normalised image coordinates."""
    return moments.of_polygon(camera.normalise(corners))


def moments_of_state(state: State, region: Region, camera: Camera) -> Moments:
    """The moments of the rectangle in which a tracker sees the target."""
    x, y = (state.x - camera.cx) / camera.fx, (state.y - camera.cy) / camera.fy
    width, height = state.scale * region.width, state.scale * region.height
    return moments.of_rectangle(x, y, width, height, state.theta, (1 / camera.fx, 1 / camera.fy))


def facing_plane(m: Moments, root_area: float) -> Plane:
    """The plane parallel to the image in which a target of known metric area has these moments.

    Args:
        m: What is seen.
        root_area: Square root of the metric area [m].
    """
    return plane_of_size(m, root_area, np.array([0.0, 0.0, 1.0]))


def plane_of_size(m: Moments, root_area: float, normal: Array) -> Plane:
    """The plane with this normal (3,) in which a target of known metric area has these moments.

    A small piece S of the plane n P = 1 has the image area a = S (n r)^3 / |n|, where r = (xg, yg,
    1): this gives |n|, and with it the depth, from size alone.
    """
    A, B, C = normal.tolist()
    facing = (A * m.xg + B * m.yg + C) / sqrt(A * A + B * B + C * C)
    return plane_of_depth(m, root_area * sqrt(max(facing, EDGE_ON) / m.area), normal)


def plane_of_depth(m: Moments, depth: float, normal: Array) -> Plane:
    """The plane with this normal (3,), at a depth [m] where the target's centre is seen."""
    A, B, C = normal.tolist()
    along = depth * (A * m.xg + B * m.yg + C)
    return Plane(A / along, B / along, C / along)


def plane_of(T_camera_target: Pose, height: float) -> Plane:
    """The plane at a height [m] over the target's origin, level in the target's frame."""
    normal = T_camera_target.rotation[:, 2]
    through = T_camera_target.translation + height * normal
    return Plane(*(normal / (normal @ through)).tolist())


def half_turn(angle: float) -> float:
    """An angle [rad] wrapped to (-pi/2, pi/2]: moments do not tell front from back."""
    return np.pi / 2 - (np.pi / 2 - angle) % np.pi


def error_of(seen: Array, goal: Array) -> Array:
    """The error e = s - s* (4,), its angle wrapped."""
    e = seen - goal
    e[3] = half_turn(e[3])
    return e
