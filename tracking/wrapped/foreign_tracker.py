"""A tracker of another author with the interface of `tracking.types.Tracker`.

Its boxes or quadrilaterals are converted to states. Our colour histogram, or the tracker's own
score, decides whether the target is seen.
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
"""Indices of a quadrilateral's four corners, from each corner on, in both senses."""
LIMITS = LossLimits(floor=0.5, cap=0.75)
"""Limits of the histogram's distance: with hard bins, even that of a seen target is far above 0."""


@dataclass(frozen=True)
class JudgeSettings:
    """Settings of a tracker of another author: how it is decided whether the target is seen, and
    whether the size is followed.
    """

    needs = frozenset({Channel.PICTURE})

    judge: Literal["histogram", "score"] = "histogram"
    """Decide by our colour histogram in the tracker's box, or by the tracker's own score."""
    least_score: Share = 0.3
    """With judge = "score": below this score the target is not seen."""
    follow_size: bool = True
    """The scale follows the size of the tracker's boxes, once it has changed."""


class RegionSource(Protocol):
    """Connection to a tracker of another author: an object in this process, or a server."""

    def start(self, image: Image, region: Region, state: State) -> Box:
        """Start the tracker on the first picture, RGB (H, W, 3).

        Returns:
            The box x, y, width, height [px] around the region at the state.
        """
        ...

    def update(self, image: Image) -> Array | None:
        """Return where the tracker finds the target in the next picture, RGB (H, W, 3).

        Returns:
            A box (4,) x, y, width, height, or the corners (4, 2) of a convex quadrilateral [px];
            None where the target is not seen.
        """

    def score(self) -> float:
        """Return how sure the tracker itself is of its last answer, from 0 (lost) to 1
        (certain).
        """
        ...


@final
class ForeignTracker:
    """Tracker with our interface (`tracking.types.Tracker`) around a tracker of another author.

    Boxes of the other tracker move and scale the region; its quadrilaterals also turn the region,
    and are reported as corners. The camera's motion is ignored.
    """

    _source: RegionSource = SET_BY_START

    def __init__(self, settings: JudgeSettings, make: Callable[[], RegionSource]) -> None:
        """Prepare a tracker; `make` is called by `start`, and returns a new tracker of the other
        author.
        """
        self._settings = settings
        self._make = make

    def start(self, frame: Frame, region: Region, state: State) -> None:
        """Make a new tracker of the other author and start it on the first frame.

        Raises:
            ValueError: The region is not valid, or the tracker cannot be made or refuses the
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
        """Return the estimate by the other tracker's answer; the last state where it finds nothing.

        Args:
            frame: The next frame.
            ego: Not used.

        Raises:
            ValueError: The other tracker fails, or its answer is not a region.
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
        """Return the target's distance, 0..1, at the current placement, and its status."""
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
    """Converts the boxes or corners of another tracker into states of our region.

    A box moves the centre and scales the region by the square root of the box's area, both relative
    to the first box; the angle keeps its first value. Four corners also turn the region, by the
    similarity that maps the first corners to them with least squares.
    """

    turns = False
    """True once corners were given that are not those of an upright box."""
    resizes = False
    """True once the size has changed."""

    def __init__(self, region: Region, state: State, box: Array, *, sizes: bool) -> None:
        """Begin with the target in the first picture.

        Args:
            region: Size of the target in the first picture [px].
            state: State of the target in the first picture.
            box: Upright box (4,) x, y, width, height [px] with which the tracker was started.
            sizes: Follow the size, too.
        """
        self._first = state
        self._corners = region.corners(state)
        self._box = box
        self.state = state
        self._last = self._corners
        self._sizes = sizes

    def follow_box(self, box: Array) -> None:
        """Set `state` by a box (4,): x, y, width, height [px], with sides above 0."""
        moved = box[:2] + box[2:] / 2 - self._box[:2] - self._box[2:] / 2
        grown = float(np.log(box[2] * box[3] / (self._box[2] * self._box[3]))) / 2
        self._move(np.array([*moved, 0.0, grown]))

    def follow_corners(self, corners: Array) -> Array:
        """Set `state` by the corners (4, 2) of a convex quadrilateral [px], from any corner on.

        Returns:
            The corners (4, 2) in the order of `Region.corners`.
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
        """Set `state` to the first state plus a change (4,) of x, y [px], theta [rad], ln scale."""
        self.resizes = self._sizes and (self.resizes or abs(float(change[3])) > RESIZED)
        self.state = self._first.moved(change * (1, 1, 1, self.resizes))

    def _distance(self, corners: Array) -> float:
        """Return the sum of squared distances [px^2] of corners (4, 2) from the last ones, both
        relative to their centres.
        """
        around = self._last - self._last.mean(axis=0)
        return float(np.square(corners - corners.mean(axis=0) - around).sum())


def _complex(points: Array) -> np.ndarray:
    return points[:, 0] + 1j * points[:, 1]


def _upright(corners: Array) -> bool:
    """Return True if the sides of a quadrilateral (4, 2) [px] lie along the image's axes."""
    sides = np.abs(np.diff(corners, axis=0, append=corners[:1]))
    return bool((sides.min(axis=1) <= UPRIGHT * sides.max()).all())
