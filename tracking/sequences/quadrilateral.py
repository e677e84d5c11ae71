"""Four corners of a target (4, 2): conversion from and to boxes, and to a region with its state."""

import numpy as np

from sim.types import Array
from tracking.types import Region, State, turns_of

BOX = 4
"""Number of numbers of a box: left, top, width, height."""
QUAD = 8
"""Number of coordinates of four corners."""
RECTANGULAR = 0.02
"""Largest deviation of a rectangle from right angles, over its longer side; chosen by hand."""


def corners_of(numbers: Array) -> Array:
    """Return four corners (4, 2) [px]: those of a box (4,) of left, top, width, height [px],
    clockwise from the top left one; or, from coordinates x1, y1 ... x4, y4 (8,) [px], these points
    in their order.

    >>> corners_of(np.array([10.0, 20.0, 30.0, 40.0])).tolist()
    [[10.0, 20.0], [40.0, 20.0], [40.0, 60.0], [10.0, 60.0]]
    """
    if len(numbers) == QUAD:
        return numbers.reshape(4, 2)
    x, y, w, h = numbers
    return np.array([[x, y], [x + w, y], [x + w, y + h], [x, y + h]])


def boxes(corners: Array) -> Array:
    """Return upright boxes (n, 4), left, top, width, height [px], around the m corners of each of n
    outlines (n, m, 2) [px].
    """
    low = corners.min(axis=1)
    high = corners.max(axis=1)
    return np.hstack([low, high - low])


def placement(corners: Array, *, turned: bool = False) -> tuple[Region, State]:
    """Return the region [px] of a target with given corners in a picture, and its state there.

    Args:
        corners: Corners (4, 2) [px] in order around the target, the first edge along its x axis.
        turned: Keep the angle if the corners form a rectangle. Otherwise, and for other
            quadrilaterals, region and state are those of the upright box around the corners.

    Returns:
        Region and state, whose scale is 1.
    """
    edges = np.roll(corners, -1, axis=0) - corners
    width = np.hypot(*edges[0])
    height = np.hypot(*edges[1])
    square = np.abs(edges[0] + edges[2]).max() + abs(edges[0] @ edges[1]) / max(width, 1e-9)
    x, y = corners.mean(axis=0).tolist()
    if turned and square <= RECTANGULAR * max(width, height):
        theta = float(np.arctan2(edges[0][1], edges[0][0]))
        return Region(float(width), float(height)), State(x, y, theta)
    left, top, w, h = boxes(corners[None])[0].tolist()
    return Region(w, h), State(left + w / 2, top + h / 2)


def crosses_itself(corners: Array) -> bool:
    """Return True if two opposite sides of a quadrilateral (4, 2) cross each other."""
    turns = turns_of(corners)
    # A convex outline turns four times to one side, a concave one three times, a crossed one twice.
    return bool((turns > 0).sum() == 2 == (turns < 0).sum())
