"""Boxes, quadrilaterals and scores as other trackers give them."""

import reprlib
from typing import Any

import cv2
import numpy as np

from sim.types import Array, Image
from tracking.types import FARTHEST, Region, State

Box = tuple[int, int, int, int]
"""x, y, width, height of a box without rotation [px]."""
SLACK = 1e-3
"""A score may leave 0..1 by this much: single precision adds up to that."""
LEAST_SIDE = 1e-6
"""A box with a shorter side [px] has no area: products of smaller ones would vanish."""
EXPECTED = "(ok, box) or a box of x, y, width, height"


def box_of(region: Region, state: State, image: Image) -> Box:
    """Return the upright box of a region, inside the image and at least one pixel large."""
    corners = region.corners(state)
    height, width = image.shape[:2]
    low = np.clip(np.floor(corners.min(axis=0)), 0, (width - 1, height - 1)).astype(int)
    high = np.clip(np.ceil(corners.max(axis=0)), low + 1, (width, height)).astype(int)
    return int(low[0]), int(low[1]), int(high[0] - low[0]), int(high[1] - low[1])


def convex(corners: Array) -> bool:
    """Return whether corners (4, 2) are a convex quadrilateral with an area."""
    points = corners.astype(np.float32)
    return cv2.contourArea(points) > 0 and cv2.isContourConvex(points)


def box_in(answer: Any, name: str) -> Array | None:
    """Return the box (4,) in an answer of `update`; None for ok = False, or a box of zeros.

    Raises:
        ValueError: It is something else; the message names the tracker and what it returned.
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
    if box.shape != (4,) or not (np.abs(box) <= FARTHEST).all():  # nan is not
        raise ValueError(f"{name}: update returned {shown(answer)}; {EXPECTED} is expected")
    if box[2:].min() < LEAST_SIDE:
        raise ValueError(f"{name}: update returned {shown(answer)}, a box without an area")
    return box


def score_in(answer: Any, name: str) -> float:
    """Return a tracker's score, kept within 0..1.

    Raises:
        ValueError: It is none; the message names the tracker and its score.
    """
    try:
        score = float(answer)
    except (TypeError, ValueError):
        score = float("nan")
    if not -SLACK <= score <= 1 + SLACK:
        raise ValueError(f"{name}: the score is {shown(answer)}; a score lies between 0 and 1")
    return min(max(score, 0.0), 1.0)


def shown(answer: Any) -> str:
    """Return a tracker's answer on one short line."""
    return " ".join(reprlib.repr(answer).split())
