"""Upright boxes around the target's rectangle, in fractions of pixels and in whole pixels."""

import numpy as np

from sim.types import Array, Image
from tracking.guests.report import DIGITS
from tracking.types import Region, State

Box = tuple[int, int, int, int]
"""Left, top, width, height of an upright box [px]."""


def box_of(region: Region, state: State, image: Image) -> Box:
    """Return the smallest upright box of whole pixels (left, top, width, height) that contains a
    region at a state, cut off at the borders of the image (H, W, 3); at least one pixel wide and
    high.
    """
    corners = region.corners(state)
    height, width = image.shape[:2]
    low = np.clip(np.floor(corners.min(axis=0)), 0, (width - 1, height - 1)).astype(int)
    high = np.clip(np.ceil(corners.max(axis=0)), low + 1, (width, height)).astype(int)
    return int(low[0]), int(low[1]), int(high[0] - low[0]), int(high[1] - low[1])


def exact_box(region: Region, state: State, image: Image) -> Array:
    """Return the upright box (4,) of left, top, width, height [px] around a region at a state, cut
    off at the borders of the image (H, W, 3), and rounded to a millionth of a pixel. A box beside
    the image has the width 0, one above or below it the height 0.
    """
    corners = region.corners(state)
    height, width = image.shape[:2]
    low = np.clip(corners.min(axis=0), 0, (width, height))
    high = np.clip(corners.max(axis=0), 0, (width, height))
    return np.concatenate([low, high - low]).round(DIGITS)


def whole_box(box: Array) -> Box:
    """Return the box of whole pixels whose edges are nearest to those of a box (4,) of left, top,
    width, height [px]; at least one pixel wide and high.
    """
    low = box[:2].round()
    sides = np.maximum((box[:2] + box[2:]).round() - low, 1)
    left, top, width, height = (int(number) for number in (*low, *sides))
    return left, top, width, height
