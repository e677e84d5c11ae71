"""Linear bounds lower <= A v <= upper of a camera twist v, each with a name: of its speed, of the
joints' rates, and of the velocities of the target's corners in the picture.
"""

from dataclasses import dataclass, replace
from functools import cache
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from servo.controllers._limits import DesiredTwist
from servo.sight.point_rows import corner_rows, corners_of
from servo.types import Sight
from sim.geometry import inverse_if_strong, is_finite
from sim.types import Array, Camera, Posture

SINGULAR = 0.01
"""Singular values of a robot's Jacobian below this share of the largest count as zero."""
RANGE_MARGIN = 0.01
"""Distance that a joint keeps from the ends of its range [m or rad]; the robot itself stops there.
"""
RANGE_GAIN = 8.0
"""Largest rate at which a joint may approach the end of its range, over the distance left [1/s]:
the robot's own. At most the frame rate counts."""
STEP = 1e-6
"""Step of the finite differences that linearise a lens, in normalised coordinates."""
NEVER = 1e30
"""DAQP ignores bounds of this size."""
SIDES = (*[("view left", "view right")] * 4, *[("view top", "view bottom")] * 4)


@dataclass(frozen=True, slots=True)
class Bounds:
    """Linear bounds lower <= A v <= upper of a camera twist v (6,), with the name of each bound."""

    A: Array
    """Rows (m, 6), one for each bound."""
    lower: Array
    """Lower bounds (m,)."""
    upper: Array
    """Upper bounds (m,)."""
    names: tuple[tuple[str, str], ...]
    """Names of each row's lower and upper bound, such as ("view left", "view right")."""

    def __add__(self, other: "Bounds") -> "Bounds":
        return Bounds(
            np.concatenate([self.A, other.A]),
            np.concatenate([self.lower, other.lower]),
            np.concatenate([self.upper, other.upper]),
            self.names + other.names,
        )

    def excess(self, v: Array) -> Array:
        """Return by how much A v exceeds each bound (m,): positive above the upper bound, negative
        below the lower one, 0 between them; v is the twist (6,).
        """
        at = self.A @ v
        return at - at.clip(self.lower, self.upper)

    def names_at(self, sides: NDArray[np.generic]) -> tuple[str, ...]:
        """Return the names of the bounds that `sides` marks, in the order of the rows, each name
        once.

        Args:
            sides: Marks (m,), one for each row of A: positive for its upper bound, negative for its
                lower bound, 0 for neither.
        """
        found = (self.names[i][int(sides[i] > 0)] for i in np.flatnonzero(sides))
        return tuple(dict.fromkeys(found))


UNBOUNDED = Bounds(np.zeros((0, 6)), np.zeros(0), np.zeros(0), ())
"""No bounds."""


def speed_bounds(fastest: float, fastest_turn: float) -> Bounds:
    """Return bounds of each component of the camera twist by itself: |vx|, |vy|, |vz| <= fastest
    and |wx|, |wy|, |wz| <= fastest_turn.

    Args:
        fastest: Largest speed [m/s].
        fastest_turn: Largest angular speed [rad/s].
    """
    most = np.repeat([fastest, fastest_turn], 3)
    return Bounds(np.eye(6), -most, most, (("speed", "speed"),) * 6)


def joint_bounds(posture: Posture, way: Array, dt: float) -> Bounds | None:
    """Return bounds of the joint rates that a camera twist v needs, J# v with the pseudo-inverse J#
    of the robot's Jacobian. A joint may approach the end of its range with at most 8 times the
    distance left per second (with the frame rate, if that is lower), and no joint may exceed its
    largest rate. The distance is counted from where the joint is when the twist begins to act, to
    0.01 m or rad before the end. A twist of zero always satisfies the bounds.

    Args:
        posture: Joints, limits and Jacobian of the robot.
        way: Displacement (6,) of the camera until the twist acts, which earlier commands cause [m,
            rad].
        dt: Time since the last picture [s].

    Returns:
        The bounds; None if the robot has no joints, or no finite Jacobian.
    """
    ranges = range_bounds(posture, way, dt)
    if ranges is None:
        return None
    # The tighter of both limits counts.
    lower = np.maximum(ranges.lower, posture.slowest)
    upper = np.minimum(ranges.upper, posture.fastest)
    return replace(ranges, lower=lower, upper=upper)


def range_bounds(posture: Posture, way: Array, dt: float) -> Bounds | None:
    """Return bounds as `joint_bounds` does, from the joints' ranges alone, without their largest
    rates; arguments and result are those of `joint_bounds`.
    """
    p = posture
    J = posture.jacobian
    if J.size == 0 or not is_finite(J):
        return None
    A = inverse_of(J)
    q = p.joints + A @ way  # where the joints are when the twist begins to act
    # A larger gain than the frame rate would overshoot within one frame.
    gain = min(RANGE_GAIN, 1 / dt)
    back = (gain * (p.lower + RANGE_MARGIN - q)).clip(-NEVER, 0.0)
    on = (gain * (p.upper - RANGE_MARGIN - q)).clip(0.0, NEVER)
    return Bounds(A, back, on, _names_of_joints(len(q)))


@cache
def _names_of_joints(count: int) -> tuple[tuple[str, str], ...]:
    return tuple((f"joint {i}", f"joint {i}") for i in range(1, count + 1))


def inverse_of(J: Array) -> Array:
    """Return the pseudo-inverse J# (n, 6) of a Jacobian (6, n). Singular values below 1 % of the
    largest count as zero, so that their directions map to zero; a square Jacobian whose singular
    values are all clearly above that is inverted as it is.
    """
    if J.shape[0] == J.shape[1]:
        # Its norm is at least the largest singular value.
        plain = inverse_if_strong(J, SINGULAR * sqrt(np.vdot(J, J)))
        if plain is not None:
            return plain
    return np.linalg.pinv(J, SINGULAR).astype(np.float64)


def view_bounds(
    desired: DesiredTwist, seen: Sight, camera: Camera, margin: float, gain: float
) -> Bounds:
    """Return bounds of a camera twist that keep the target's corners in the picture: each corner's
    velocity [px/s] towards a side of the picture is at most `gain` times its distance from the
    margin there.

    Args:
        desired: The law's twist, with the displacement of the camera until it acts and the motion
            of the target.
        seen: The target in the picture, with its four corners.
        camera: Size of the picture [px], and intrinsics.
        margin: Distance that the corners keep from the sides of the picture [px].
        gain: Largest velocity of a corner towards a side, over the distance left [1/s].
    """
    pixels = camera.to_pixels(corners_of(seen))
    A = _pixel_rows(seen, camera)
    at = pixels.T.ravel() + A @ desired.way
    # The target moves the corners too: the bound is on both motions together.
    drift = A @ desired.target
    size = np.repeat([camera.width, camera.height], 4)
    return Bounds(A, gain * (margin - at) - drift, gain * (size - margin - at) - drift, SIDES)


def _pixel_rows(seen: Sight, camera: Camera) -> Array:
    """Return the interaction matrix (8, 6) of the four corners' pixel coordinates, through the
    lens: four rows of u, then four of v [px/s per m/s or rad/s].
    """
    rows = corner_rows(seen)
    if camera.distortion is None:
        return np.concatenate([camera.fx * rows[0], camera.fy * rows[1]])
    # A lens: the chain rule, with the derivatives of the pixel by x and by y.
    corners = corners_of(seen)
    here = camera.to_pixels(corners)
    there = camera.to_pixels(corners + STEP * np.eye(2)[:, None])
    by_x, by_y = (there - here).transpose(0, 2, 1).reshape(2, 8, 1) / STEP
    return by_x * np.tile(rows[0], (2, 1)) + by_y * np.tile(rows[1], (2, 1))
