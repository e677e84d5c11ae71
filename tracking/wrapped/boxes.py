"""Boxes of regions, and checks of the boxes and scores that trackers of other authors return."""

import reprlib
from typing import Any

import cv2
import numpy as np

from sim.types import Array, Image
from tracking.types import FARTHEST, Region, State

Box = tuple[int, int, int, int]
"""x, y, width, height of a box without rotation [px]."""
SLACK = 1e-3
"""A score may leave 0..1 by this much: rounding errors of single precision."""
LEAST_SIDE = 1e-6
"""Shortest side of a box with an area [px]: the product of shorter sides could underflow to 0."""


def box_of(region: Region, state: State, image: Image) -> Box:
    """Return the upright box x, y, width, height [px] around a region at a state, cut to the image
    (H, W, 3); at least one pixel wide and high.
    """
    corners = region.corners(state)
    height, width = image.shape[:2]
    low = np.clip(np.floor(corners.min(axis=0)), 0, (width - 1, height - 1)).astype(int)
    high = np.clip(np.ceil(corners.max(axis=0)), low + 1, (width, height)).astype(int)
    return int(low[0]), int(low[1]), int(high[0] - low[0]), int(high[1] - low[1])


def convex(corners: Array) -> bool:
    """Return True if corners (4, 2) [px] form a convex quadrilateral with an area above 0."""
    points = corners.astype(np.float32)
    return cv2.contourArea(points) > 0 and cv2.isContourConvex(points)


def box_in(answer: object, name: str) -> Array | None:
    """Return the box (4,) x, y, width, height [px] that a tracker's `update` returned.

    Args:
        answer: A box, or (ok, box).
        name: Name of the tracker, for messages.

    Returns:
        None where the target is not seen: ok is False, or the box has only zeros.

    Raises:
        ValueError: The answer is neither of the two, or the box has no area.
    """
    given = answer
    if isinstance(answer, tuple | list) and len(answer) == 2 and np.ndim(answer[0]) == 0:
        ok, given = answer
        if not ok:
            return None
    try:
        box = np.asarray(given, dtype=float)
    except (TypeError, ValueError):
        box = np.empty(0)
    if box.shape == (4,) and not box.any():
        return None
    is_box = box.shape == (4,) and (np.abs(box) <= FARTHEST).all()  # nan is not
    if not is_box or box[2:].min() < LEAST_SIDE:
        raise ValueError(
            f"{name}: update returned {shown(answer)}; expected (ok, box) or a box of x, y, width, "
            "height with an area"
        )
    return box


def score_in(answer: Any, name: str) -> float:
    """Return the score that a tracker gives its own answer, from 0 (lost) to 1 (certain), as a
    number clipped to this range.

    Args:
        answer: The score that the tracker returned.
        name: Name of the tracker, for messages.

    Raises:
        ValueError: The score is not a number of 0 to 1.
    """
    try:
        score = float(answer)
    except (TypeError, ValueError):
        score = float("nan")
    if not -SLACK <= score <= 1 + SLACK:
        raise ValueError(f"{name}: the score is {shown(answer)}: expected a number from 0 to 1")
    return min(max(score, 0.0), 1.0)


def shown(answer: object) -> str:
    """Return a value that a tracker returned as one short line of text, for messages."""
    return " ".join(reprlib.repr(answer).split())
