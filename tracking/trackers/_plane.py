"""A rectangle in a plane, seen in perspective: homographies, and the state of its corners."""

import cv2
import numpy as np

from sim.outline import area
from sim.types import Array
from tracking.types import Region, State

SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]) / 2
"""Corners (4, 2) of a unit square, in the order of a region's."""


def homography(source: Array, target: Array) -> Array:
    """Return the homography (3, 3), with its last element 1, that maps four source points (4, 2) to
    target points (4, 2).
    """
    H = cv2.getPerspectiveTransform(source.astype(np.float32), target.astype(np.float32))
    return H.astype(np.float64)


def through(H: Array, points: Array) -> Array:
    """Return the points (n, 2) to which a homography (3, 3) maps points (n, 2)."""
    # Sums in a fixed order: BLAS, behind a matrix product, may choose another on each processor.
    x, y = points[:, :1], points[:, 1:]
    seen = x * H[:, 0] + y * H[:, 1] + H[:, 2]
    return seen[:, :2] / seen[:, 2:]


def state_of(corners: Array, region: Region, last: State) -> State:
    """Return the state of a region from its corners in the picture: centre (where the diagonals
    cross), angle from there to the middle of the side between the second and the third corner, and
    scale by the root of the area.

    Args:
        corners: The region's corners (4, 2) [px].
        region: The region, whose area gives scale 1.
        last: The last state; the new angle is the one within half a turn of it.
    """
    # In perspective the centre is where the diagonals cross, not the mean of the corners.
    centre, nose = through(homography(SQUARE, corners), np.array([[0.0, 0.0], [0.5, 0.0]]))
    theta = float(np.arctan2(*(nose - centre)[::-1]))
    # The arctangent jumps at pi: the whole turn nearest to the last angle is added.
    theta += 2 * np.pi * round((last.theta - theta) / (2 * np.pi))
    scale = np.sqrt(area(corners) / (region.width * region.height))
    return State(float(centre[0]), float(centre[1]), theta, float(scale))
