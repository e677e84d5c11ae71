"""Another tracker as one of ours: its regions become states, and a judge decides whether the target
is seen.
"""

from collections.abc import Callable
from typing import Protocol, final

import numpy as np

from sim.types import Array, Frame, Image
from tracking.external.boxes import Box, Placement
from tracking.external.judge import Judge, JudgeSettings
from tracking.types import Estimate, Region, State, check_region, unknown_covariance


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
