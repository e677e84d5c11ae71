"""Boxes and quadrilaterals of other trackers as states of ours."""

import cv2
import numpy as np

from sim.types import Array, Image
from tracking.types import Region, State

Box = tuple[int, int, int, int]
"""x, y, width, height of a box without rotation [px]."""
UPRIGHT = 1e-3
"""A quadrilateral whose sides leave the axes by less than this, over its size, has no angle."""
RESIZED = 1e-3
"""A change of ln scale by less than this is none."""
ORDERS = [np.roll(order, k) for k in range(4) for order in ((0, 1, 2, 3), (3, 2, 1, 0))]
"""The orders in which four corners may be given."""


def box_of(region: Region, state: State, image: Image) -> Box:
    """Return the upright box of a region, inside the image and at least one pixel large."""
    corners = region.corners(state)
    height, width = image.shape[:2]
    low = np.clip(np.floor(corners.min(axis=0)), 0, (width - 1, height - 1)).astype(int)
    high = np.clip(np.ceil(corners.max(axis=0)), low + 1, (width, height)).astype(int)
    return int(low[0]), int(low[1]), int(high[0] - low[0]), int(high[1] - low[1])


class Placement:
    """The state of a region whose box, or whose corners, another tracker follows.

    A box moves the centre and scales the region by the square root of its area, both relative to
    the first box; the angle stays as it began. Four corners turn the region, too: the similarity
    nearest to them (least squares) takes its first corners there.
    """

    turns = False
    """True once corners that have an angle were given."""
    resizes = False
    """True once the size has changed."""

    def __init__(self, region: Region, state: State, box: Array, *, sizes: bool) -> None:
        """Begin with a region and the box (4,) that the tracker gets for it [px].

        Args:
            region: The template.
            state: State of the target at first.
            box: The upright box around it, as the tracker gets it [px].
            sizes: Take over the size, too.
        """
        self._first = state
        self._corners = region.corners(state)
        self._box = box
        self.state = state
        self._last = self._corners
        self._sizes = sizes

    def follow_box(self, box: Array) -> None:
        """Take over a box (4,): x, y, width, height [px], with a size above zero."""
        moved = box[:2] + box[2:] / 2 - self._box[:2] - self._box[2:] / 2
        grown = float(np.log(box[2] * box[3] / (self._box[2] * self._box[3]))) / 2
        self._move(np.array([*moved, 0.0, grown]))

    def follow_corners(self, corners: Array) -> Array:
        """Take over the corners (4, 2) of a convex quadrilateral [px].

        Returns:
            The corners in the order of the region's.
        """
        seen = min((corners[order] for order in ORDERS), key=self._distance)
        self._last = seen
        moved = seen.mean(axis=0) - self._corners.mean(axis=0)
        was, now = (_complex(c - c.mean(axis=0)) for c in (self._corners, seen))
        factor = complex(np.vdot(was, now) / np.vdot(was, was))
        turn = float(np.angle(factor))
        before = self.state.theta - self._first.theta
        turn += 2 * np.pi * round((before - turn) / (2 * np.pi))  # the angle is continuous
        self.turns = self.turns or not _upright(seen)
        self._move(np.array([*moved, turn if self.turns else 0.0, np.log(max(abs(factor), 1e-9))]))
        return seen

    def _move(self, change: Array) -> None:
        self.resizes = self._sizes and (self.resizes or abs(float(change[3])) > RESIZED)
        self.state = self._first.moved(change * (1, 1, 1, self.resizes))

    def _distance(self, corners: Array) -> float:
        around = self._last - self._last.mean(axis=0)
        return float(np.square(corners - corners.mean(axis=0) - around).sum())


def convex(corners: Array) -> bool:
    """Return whether corners (4, 2) are a convex quadrilateral with an area."""
    points = corners.astype(np.float32)
    return cv2.contourArea(points) > 0 and cv2.isContourConvex(points)


def _complex(points: Array) -> np.ndarray:
    return points[:, 0] + 1j * points[:, 1]


def _upright(corners: Array) -> bool:
    """Return whether the sides of a quadrilateral (4, 2) lie along the axes."""
    sides = np.abs(np.diff(corners, axis=0, append=corners[:1]))
    return bool((sides.min(axis=1) <= UPRIGHT * sides.max()).all())
