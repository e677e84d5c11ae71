"""A tracker in a process of its own, in any language, over the TraX protocol (Cehovin 2017)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, final

import numpy as np
from annotated_types import Ge, Le

from sim.types import Array, Frame
from tracking.external.boxes import Placement, box_of, convex
from tracking.external.conventions import box_in, score_in
from tracking.external.judge import Judge, JudgeSettings
from tracking.external.trax_client import TraxClient
from tracking.types import FARTHEST, Estimate, Region, State, check_region, unknown_covariance

CONFIDENCE = "confidence"
"""What servers call their score."""


@dataclass(frozen=True, slots=True)
class Config(JudgeSettings):
    """The server, and what judges it: its score is the `confidence` it reports."""

    not_from_file = ("command",)
    """Settings that a file may not give: files are data, and nothing in them is run."""

    command: str = ""
    """The server with its arguments, such as "python my_tracker.py"; run without a shell."""
    timeout: Annotated[float, Ge(0.1), Le(3600)] = 30.0
    """Longest wait for an answer [s]; the first one waits for the server's start, too."""

    def build(self, rng: np.random.Generator) -> TraxTracker:
        """Return the tracker; it draws nothing."""
        return TraxTracker(self)


@final
class TraxTracker:
    """Boxes move and scale the region; quadrilaterals turn it, too, and are reported as corners."""

    def __init__(self, config: Config) -> None:
        self._config = config

    def start(self, frame: Frame, region: Region, state: State) -> None:
        """Start the server, anew each time, and show it the first frame.

        Raises:
            ValueError: The region is none, or the server fails.
        """
        check_region(frame, region, state)
        c = self._config
        image = np.ascontiguousarray(frame.image)
        box = np.array(box_of(region, state, image), dtype=float)
        self._client = TraxClient(c.command, c.timeout)
        self._client.initialize(image, region.corners(state) if self._client.polygons else box)
        self._placement = Placement(region, state, box, sizes=c.follow_size)
        self._judge = Judge(c, frame, region, state)

    def update(self, frame: Frame, ego: Array | None = None) -> Estimate:
        """Ask the server.

        Raises:
            ValueError: The server has ended, hangs, or answers what is no region.
        """
        found, named = self._client.frame(np.ascontiguousarray(frame.image))
        corners = None if found is None else self._take(found)
        if found is None:
            distance, status = self._judge.unseen(frame)
        else:
            score = self._score(named) if self._config.judge == "score" else None
            distance, status = self._judge.seen(frame, self._placement.state, score)
        follows = (self._placement.turns, self._placement.resizes)
        return Estimate(
            self._placement.state, unknown_covariance(), distance, status, follows, corners=corners
        )

    def _take(self, found: Array) -> Array | None:
        """Take over a region; its corners where they are those of a convex quadrilateral."""
        name = f"TraX server '{self._config.command}'"
        if found.shape == (4, 2) and (np.abs(found) <= FARTHEST).all() and convex(found):
            return self._placement.follow_corners(found)
        if found.ndim > 1:
            found = np.concatenate([found.min(axis=0), np.ptp(found, axis=0)])
        if (box := box_in(found, name)) is not None:
            self._placement.follow_box(box)
        return None

    def _score(self, named: dict[str, str]) -> float:
        name = f"TraX server '{self._config.command}'"
        if CONFIDENCE not in named:
            raise ValueError(f'{name} reports no {CONFIDENCE}: judge = "histogram" needs none')
        return score_in(named[CONFIDENCE], name)
