"""A rectangle in a plane that is seen in perspective: homographies, and the state that fits it."""

import cv2
import numpy as np

from sim.outline import area
from sim.types import Array
from tracking.types import Region, State

SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]) / 2
"""Corners (4, 2) of a unit square, in the order of a region's."""


def homography(source: Array, target: Array) -> Array:
    """Return the matrix (3, 3) that takes four points (4, 2) to four others."""
    H = cv2.getPerspectiveTransform(source.astype(np.float32), target.astype(np.float32))
    return H.astype(np.float64)


def through(H: Array, points: Array) -> Array:
    """Return points (n, 2) after a homography."""
    seen = np.column_stack([points, np.ones(len(points))]) @ H.T
    return seen[:, :2] / seen[:, 2:]


def state_of(corners: Array, region: Region, last: State) -> State:
    """Return the state of a region whose corners are seen at (4, 2): centre, direction of the nose
    and root of the area as `sim.types.Truth` defines them; the angle continues the last one.
    """
    centre, nose = through(homography(SQUARE, corners), np.array([[0.0, 0.0], [0.5, 0.0]]))
    theta = float(np.arctan2(*(nose - centre)[::-1]))
    theta += 2 * np.pi * round((last.theta - theta) / (2 * np.pi))
    scale = np.sqrt(area(corners) / (region.width * region.height))
    return State(float(centre[0]), float(centre[1]), theta, float(scale))
