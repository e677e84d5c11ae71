"""A whole picture turned back by a target's angle, so that the target stands upright in it."""

import math

import numpy as np

from sim.types import Array, Image


def turned_back(image: Image, theta: float, steps: Array) -> tuple[Array, Array]:
    """Return where the points of a picture lie that is turned by -theta, holds all of the given
    one, and has a point every so many pixels: the affine matrix (2, 3) from its coordinates to the
    picture's [px], and its width and height (2,), not rounded.

    Args:
        image: The picture (H, W) or (H, W, 3).
        theta: The target's angle [rad], from right towards down.
        steps: Distances of neighbouring points along the target's own axes (2,) [px].
    """
    c = math.cos(theta)
    s = math.sin(theta)
    turn = np.array([[c, -s], [s, c]]) * steps
    height, width = image.shape[:2]
    corners = np.array([[0, 0], [width, 0], [0, height], [width, height]]) @ np.linalg.inv(turn).T
    return np.column_stack([turn, turn @ corners.min(axis=0)]), np.ptp(corners, axis=0)


def between_centres(place: Array) -> Array:
    """Return the same affine matrix (2, 3) for coordinates that count from the centre of the first
    pixel, as OpenCV's do, not from its corner.
    """
    moved = place.copy()
    moved[:, 2] += place[:, :2] @ [0.5, 0.5] - 0.5
    return moved
