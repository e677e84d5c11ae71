"""A tracker of another author with our interface.

Its boxes or quadrilaterals become states. Our colour histogram, or the tracker's own score, decides
whether the target is seen.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, Protocol, final

import numpy as np

from sim.channels import Channel
from sim.ranges import Share
from sim.types import Array, Frame, Image
from tracking.appearance.model import AppearanceSettings
from tracking.loss import LossJudge, LossLimits
from tracking.types import (
    SET_BY_START,
    Estimate,
    Region,
    State,
    Status,
    check_region,
    goes_around,
    unknown_covariance,
)
from tracking.wrapped.boxes import Box

UPRIGHT = 1e-3
"""Largest deviation of an upright quadrilateral's sides from the axes, over its longest side."""
RESIZED = 1e-3
"""Smallest change of ln scale that counts as a change of size."""
ORDERS = [np.roll(order, k) for k in range(4) for order in ((0, 1, 2, 3), (3, 2, 1, 0))]
"""All orders of four corners around a quadrilateral, in both senses."""
LIMITS = LossLimits(floor=0.5, cap=0.75)
"""Limits of the histogram's distance; of hard bins, that of a seen target is not near 0."""


@dataclass(frozen=True)
class JudgeSettings:
    """Settings that decide whether the target is seen."""

    needs = frozenset({Channel.PICTURE})

    judge: Literal["histogram", "score"] = "histogram"
    """Decide by our colour histogram of the tracker's region, or by the tracker's own score."""
    least_score: Share = 0.3
    """With judge = "score": below this score the target is not seen."""
    follow_size: bool = True
    """Follow the size of the tracker's boxes, once it has changed."""


class RegionSource(Protocol):
    """A tracker of another author: an object in this process, or a server."""

    def start(self, image: Image, region: Region, state: State) -> Box:
        """Show the first picture, RGB (H, W, 3), and the target's region; return its box [px]."""
        ...

    def update(self, image: Image) -> Array | None:
        """Return a box (4,) or the corners (4, 2) of a convex quadrilateral [px]; None where the
        target is not seen.
        """
        ...

    def score(self) -> float:
        """Return the tracker's own score of its last region, 0..1."""
        ...


@final
class ForeignTracker:
    """Our interface around a tracker of another author.

    Its boxes move and scale the region. Its quadrilaterals also turn the region, and are reported
    as corners. It is not told the camera's motion.
    """

    _source: RegionSource = SET_BY_START

    def __init__(self, settings: JudgeSettings, make: Callable[[], RegionSource]) -> None:
        self._settings = settings
        self._make = make

    def start(self, frame: Frame, region: Region, state: State) -> None:
        """Make a new tracker and show it the first frame.

        Raises:
            ValueError: The region is not valid, the tracker cannot be made, or it refuses the
                region.
        """
        check_region(frame, region, state)
        self._source = self._make()
        box = np.array(self._source.start(frame.image, region, state), dtype=float)
        self._placement = Placement(region, state, box, sizes=self._settings.follow_size)
        if self._settings.judge == "score":
            doubt = 1 - self._settings.least_score
            self._loss = LossJudge(LossLimits(floor=doubt, cap=doubt))
        else:
            self._loss = LossJudge(LIMITS)
            self._model = AppearanceSettings().model(frame.image, region, state)

    def update(self, frame: Frame, ego: Array | None = None) -> Estimate:
        """Return the estimate by the tracker's region; without a region, the last state stays.

        Args:
            frame: The next frame.
            ego: Not used.

        Raises:
            ValueError: The tracker fails, or its answer is not a region.
        """
        found = self._source.update(frame.image)
        corners = None
        if found is None:
            distance, status = 1.0, self._loss.judge(math.inf, frame.time)
        else:
            if found.ndim > 1:
                corners = self._placement.follow_corners(found)
            else:
                self._placement.follow_box(found)
            distance, status = self._judge(frame)
        follows = (self._placement.turns, self._placement.resizes)
        return Estimate(
            self._placement.state, unknown_covariance(), distance, status, follows, corners=corners
        )

    def _judge(self, frame: Frame) -> tuple[float, Status]:
        """Return distance and status of the target at the tracker's region."""
        if self._settings.judge == "score":
            distance = 1.0 - self._source.score()
            return distance, self._loss.judge(distance, frame.time)
        state = self._placement.state
        image = self._model.label(frame.image)
        distance = float(self._model.distances(image, state.vector[None])[0])
        status = self._loss.judge(distance, frame.time)
        if status is Status.LOCKED:
            self._model.learn(image, state)
        return distance, status


class Placement:
    """Converts boxes or corners of another tracker into states of the region.

    A box moves the centre and scales the region by the square root of its area, both relative to
    the first box; the angle keeps its first value. Four corners also turn the region, by the
    similarity that maps its first corners to them with the least squares.
    """

    turns = False
    """True once corners were not upright."""
    resizes = False
    """True once the size has changed."""

    def __init__(self, region: Region, state: State, box: Array, *, sizes: bool) -> None:
        """Begin with the target in the first picture.

        Args:
            region: The template.
            state: State of the target at first.
            box: The upright box around it, x, y, width, height, as the tracker gets it [px].
            sizes: Follow the size, too.
        """
        self._first = state
        self._corners = region.corners(state)
        self._box = box
        self.state = state
        self._last = self._corners
        self._sizes = sizes

    def follow_box(self, box: Array) -> None:
        """Set the state by a box (4,): x, y, width, height [px], the sides above 0."""
        moved = box[:2] + box[2:] / 2 - self._box[:2] - self._box[2:] / 2
        grown = float(np.log(box[2] * box[3] / (self._box[2] * self._box[3]))) / 2
        self._move(np.array([*moved, 0.0, grown]))

    def follow_corners(self, corners: Array) -> Array:
        """Set the state by the corners (4, 2) of a convex quadrilateral [px], in any order.

        Returns:
            The corners (4, 2) in the order of the region's own.
        """
        ordered = (corners[order] for order in ORDERS)
        # Trackers begin with any corner: the order nearest to the last corners is the region's.
        seen = min(filter(goes_around, ordered), key=self._distance)
        self._last = seen
        moved = seen.mean(axis=0) - self._corners.mean(axis=0)
        # A similarity is a complex factor: the least-squares one is <was, now> / <was, was>.
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


def _complex(points: Array) -> np.ndarray:
    return points[:, 0] + 1j * points[:, 1]


def _upright(corners: Array) -> bool:
    """Return whether the sides of a quadrilateral (4, 2) lie along the axes."""
    sides = np.abs(np.diff(corners, axis=0, append=corners[:1]))
    return bool((sides.min(axis=1) <= UPRIGHT * sides.max()).all())
