"""Another tracker as one of ours: its regions become states, and a judge decides whether the target
is seen: our histogram, or the tracker's own score.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, Protocol, final

import numpy as np

from sim.ranges import Share
from sim.types import Array, Frame, Image
from tracking.appearance.model import AppearanceSettings
from tracking.external.boxes import Box, Placement
from tracking.loss import LossJudge, LossLimits
from tracking.types import Estimate, Region, State, Status, check_region, unknown_covariance

LIMITS = LossLimits(floor=0.5, cap=0.75)
"""Limits of our histogram's distance: of hard bins, it is never near 0."""


@dataclass(frozen=True)
class JudgeSettings:
    """Settings of the judgement whether the target is seen."""

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

    def __init__(self, settings: JudgeSettings, make: Callable[[], RegionSource]) -> None:
        self._settings = settings
        self._make = make

    def start(self, frame: Frame, region: Region, state: State) -> None:
        """Make the tracker, anew each time, and show it the first frame.

        Raises:
            ValueError: The region is none; or the tracker cannot be made, or refuses the region.
        """
        check_region(frame, region, state)
        c = self._settings
        self._source = self._make()
        box = np.array(self._source.start(frame.image, region, state), dtype=float)
        self._placement = Placement(region, state, box, sizes=c.follow_size)
        self._judge = Judge(c, frame, region, state)

    def update(self, frame: Frame, ego: Array | None = None) -> Estimate:
        """Take over the tracker's region, if it gives one.

        Raises:
            ValueError: The tracker fails, or returned something that is no region.
        """
        found = self._source.update(frame.image)
        corners = None
        if found is None:
            distance, status = self._judge.unseen(frame)
        else:
            if found.ndim > 1:
                corners = self._placement.follow_corners(found)
            else:
                self._placement.follow_box(found)
            score = self._source.score() if self._settings.judge == "score" else None
            distance, status = self._judge.seen(frame, self._placement.state, score)
        follows = (self._placement.turns, self._placement.resizes)
        return Estimate(
            self._placement.state, unknown_covariance(), distance, status, follows, corners=corners
        )


class Judge:
    """Distance and status of what another tracker found."""

    def __init__(self, settings: JudgeSettings, frame: Frame, region: Region, state: State) -> None:
        """Learn the target's histogram from the first frame, if that is to judge."""
        lock = LIMITS
        self._by_score = settings.judge == "score"
        if self._by_score:
            doubt = 1 - settings.least_score
            lock = LossLimits(floor=doubt, cap=doubt)
        else:
            self._model = AppearanceSettings().model(frame.image, region, state)
        self._loss = LossJudge(lock)

    def unseen(self, frame: Frame) -> tuple[float, Status]:
        """Return distance and status of a target that the tracker itself does not find."""
        return 1.0, self._loss.judge(math.inf, frame.time)

    def seen(self, frame: Frame, state: State, score: float | None) -> tuple[float, Status]:
        """Return distance and status at a state, with the tracker's score where it has one."""
        if self._by_score:
            distance = 1.0 - (score or 0.0)
            return distance, self._loss.judge(distance, frame.time)
        image = self._model.label(frame.image)
        distance = float(self._model.distances(image, state.vector[None])[0])
        status = self._loss.judge(distance, frame.time)
        if status is Status.LOCKED:
            self._model.learn(image, state)
        return distance, status
