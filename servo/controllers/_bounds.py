"""Linear bounds on a camera twist, of its speed, of joints and of the view, each with its name."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from servo.controllers._limits import DesiredTwist
from servo.sight.point_rows import corner_rows, corners_of
from servo.types import Sight
from sim.geometry import inverse_if_strong
from sim.types import Array, Camera, Posture

SINGULAR = 0.01
"""Singular values of a robot's Jacobian below this share of the largest count as zero."""
RANGE_MARGIN = 0.01
"""Way to the end of a joint's range that is kept [m or rad]: the robot itself stops there."""
RANGE_GAIN = 8.0
"""How fast a joint may use up its way to there [1/s], as the robot has it; at most the frame rate
counts."""
STEP = 1e-6
"""Step of the differences by which the bending of a lens is linearised."""
NEVER = 1e30
"""DAQP takes a bound of this size for none."""
SIDES = (*[("view left", "view right")] * 4, *[("view top", "view bottom")] * 4)


@dataclass(frozen=True, slots=True)
class Bounds:
    """lower <= A v <= upper, for camera twists v (6,)."""

    A: Array
    """(m, 6)."""
    lower: Array
    """(m,)."""
    upper: Array
    """(m,)."""
    names: tuple[tuple[str, str], ...]
    """Of each lower and upper bound."""

    def __add__(self, other: "Bounds") -> "Bounds":
        return Bounds(
            np.concatenate([self.A, other.A]),
            np.concatenate([self.lower, other.lower]),
            np.concatenate([self.upper, other.upper]),
            self.names + other.names,
        )

    def excess(self, v: Array) -> Array:
        """Return by how much a twist (6,) is outside (m,): below a lower bound negative, inside
        zero.
        """
        at = self.A @ v
        return at - at.clip(self.lower, self.upper)

    def names_at(self, sides: NDArray[np.generic]) -> tuple[str, ...]:
        """Return the names of the upper bounds where sides (m,) are positive, of the lower where
        negative.
        """
        found = (self.names[i][int(sides[i] > 0)] for i in np.flatnonzero(sides))
        return tuple(dict.fromkeys(found))


def speed_bounds(fastest: float, fastest_turn: float) -> Bounds:
    """Return those of each part of the twist by itself [m/s, rad/s]: the box around all twists that
    are slow enough.
    """
    most = np.repeat([fastest, fastest_turn], 3)
    return Bounds(np.eye(6), -most, most, (("speed", "speed"),) * 6)


def joint_bounds(posture: Posture, way: Array, dt: float) -> Bounds | None:
    """Return those of the joint rates J# v that drives make of a twist; a joint that stands always
    keeps them.

    Args:
        posture: The robot.
        way: What the camera still moves (6,) before the twist acts [m, rad].
        dt: Time since the last frame [s].

    Returns:
        None where the posture has no joints, or no Jacobian that can be used.
    """
    ranges = range_bounds(posture, way, dt)
    if ranges is None:
        return None
    lower = np.maximum(ranges.lower, posture.slowest)
    upper = np.minimum(ranges.upper, posture.fastest)
    return replace(ranges, lower=lower, upper=upper)


def range_bounds(posture: Posture, way: Array, dt: float) -> Bounds | None:
    """Return those of `joint_bounds` that come from the joints' ranges."""
    p = posture
    J = posture.jacobian
    if J.size == 0 or not np.isfinite(J).all():
        return None
    A = inverse_of(J)
    q = p.joints + A @ way
    gain = min(RANGE_GAIN, 1 / dt)
    back = (gain * (p.lower + RANGE_MARGIN - q)).clip(-NEVER, 0.0)
    on = (gain * (p.upper - RANGE_MARGIN - q)).clip(0.0, NEVER)
    joints = [f"joint {i + 1}" for i in range(len(q))]
    names = tuple(zip(joints, joints, strict=True))
    return Bounds(A, back, on, names)


def inverse_of(J: Array) -> Array:
    """Return J# (n, 6), without its singular part."""
    plain = inverse_if_strong(J, SINGULAR) if J.shape[0] == J.shape[1] else None
    return np.linalg.pinv(J, SINGULAR).astype(np.float64) if plain is None else plain


def view_bounds(
    desired: DesiredTwist, seen: Sight, camera: Camera, margin: float, gain: float
) -> Bounds:
    """Return those of the target's corners, towards the sides of the picture [px/s].

    Args:
        desired: What the law asks for, and what it knows.
        seen: The target, with its corners.
        camera: Picture and lens.
        margin: Way to the sides that is kept [px].
        gain: How fast a corner may use up the rest [1/s].
    """
    pixels = camera.to_pixels(corners_of(seen))
    A = _pixel_rows(seen, camera)
    at = pixels.T.ravel() + A @ desired.way
    drift = A @ desired.target
    size = np.repeat([camera.width, camera.height], 4)
    return Bounds(A, gain * (margin - at) - drift, gain * (size - margin - at) - drift, SIDES)


def _pixel_rows(seen: Sight, camera: Camera) -> Array:
    """Return the interaction matrix (8, 6) of the corners in the picture [px]: four rows of u, four
    of v.
    """
    rows = corner_rows(seen)
    if camera.distortion is None:
        return np.concatenate([camera.fx * rows[0], camera.fy * rows[1]])
    corners = corners_of(seen)
    here = camera.to_pixels(corners)
    there = camera.to_pixels(corners + STEP * np.eye(2)[:, None])
    by_x, by_y = (there - here).transpose(0, 2, 1).reshape(2, 8, 1) / STEP
    return by_x * np.tile(rows[0], (2, 1)) + by_y * np.tile(rows[1], (2, 1))
