"""Another tracker as one of ours: its regions become states, and a judge decides whether the target
is seen: our histogram, or the tracker's own score.
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
"""A quadrilateral whose sides leave the axes by less than this, over its size, has no angle."""
RESIZED = 1e-3
"""A change of ln scale by less than this is none."""
ORDERS = [np.roll(order, k) for k in range(4) for order in ((0, 1, 2, 3), (3, 2, 1, 0))]
"""The orders in which four corners may be given."""
LIMITS = LossLimits(floor=0.5, cap=0.75)
"""Limits of our histogram's distance: of hard bins, it is never near 0."""


@dataclass(frozen=True)
class JudgeSettings:
    """Settings of the judgement whether the target is seen."""

    needs = frozenset({Channel.PICTURE})

    judge: Literal["histogram", "score"] = "histogram"
    """Our colour histogram of the region that the tracker gives, or the tracker's own score."""
    least_score: Share = 0.3
    """With judge = "score": below this score the target is not seen."""
    follow_size: bool = True
    """Take over the size of the tracker's boxes too, once it has changed."""


class RegionSource(Protocol):
    """Another tracker, by whatever means it is called."""

    def start(self, image: Image, region: Region, state: State) -> Box:
        """Show the first picture (H, W, 3) with the target, and return the box around it."""
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
    """Boxes move and scale the region; quadrilaterals turn it, too, and are reported as corners.

    The other tracker is given neither angle nor camera motion.
    """

    _source: RegionSource = SET_BY_START

    def __init__(self, settings: JudgeSettings, make: Callable[[], RegionSource]) -> None:
        self._settings = settings
        self._make = make

    def start(self, frame: Frame, region: Region, state: State) -> None:
        """Make the tracker, anew each time, and show it the first frame.

        Raises:
            ValueError: The region is none; or the tracker cannot be made, or refuses the region.
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
        """Take over the tracker's region, if it gives one.

        Raises:
            ValueError: The tracker fails, or returned something that is no region.
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
        """Return distance and status of the region that the tracker has given."""
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
        ordered = (corners[order] for order in ORDERS)
        seen = min(filter(goes_around, ordered), key=self._distance)
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


def _complex(points: Array) -> np.ndarray:
    return points[:, 0] + 1j * points[:, 1]


def _upright(corners: Array) -> bool:
    """Return whether the sides of a quadrilateral (4, 2) lie along the axes."""
    sides = np.abs(np.diff(corners, axis=0, append=corners[:1]))
    return bool((sides.min(axis=1) <= UPRIGHT * sides.max()).all())
