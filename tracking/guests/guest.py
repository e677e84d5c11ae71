"""A tracker of another author, a guest, as a `tracking.types.Tracker`.

A guest's reports (`tracking.guests.report`) have the same form for a class, one of OpenCV's
trackers, a program and a server of TraX. The guest itself reports whether it sees the target.
"""

import math
from dataclasses import dataclass
from typing import Annotated, Literal, Protocol, final

import numpy as np
from annotated_types import Ge, Le

from sim.channels import Channel
from sim.plain_part import DRAWN
from sim.ranges import Share
from sim.types import Array, Frame
from tracking.appearance.model import AppearanceSettings
from tracking.guests.boxes import exact_box
from tracking.guests.placement import Placement
from tracking.guests.report import Gives, Report
from tracking.loss import LossJudge, LossLimits
from tracking.types import (
    SET_BY_START,
    Estimate,
    Region,
    State,
    Status,
    check_region,
    unknown_covariance,
)

LIMITS = LossLimits(floor=0.5, cap=0.75)
"""Limits of the histogram's distance: with hard bins, even that of a seen target is far above 0."""


Limit = Annotated[float, Ge(0.1), Le(3600.0)]
"""A time limit of a tracker's answer [s]."""


class Guest(Protocol):
    """Protocol of a connection to a tracker of another author, an object in this process or a
    program: `start` is called once with the first picture, then `update` for each further one.
    """

    @property
    def gives(self) -> frozenset[Gives] | None:
        """Which of "size", "angle" and "corners" the tracker declares that it measures besides the
        centre; None: it declares nothing, and its reports show it.
        """

    @property
    def cuts(self) -> bool:
        """Whether the tracker is shown the upright box around the region cut off at the picture's
        border, so that its own boxes begin with that; False: the region's whole outline.
        """
        ...

    def start(self, frame: Frame, region: Region, state: State) -> None:
        """Show the tracker the first picture, in which the target is the rectangle `region` [px] at
        `state` (centre [px], angle [rad], scale).
        """

    def update(self, frame: Frame) -> Report:
        """Return the tracker's report on the next picture: whether it sees the target, and the box
        or corners where it sees it [px].
        """
        ...


@dataclass(frozen=True)
class GuestSettings:
    """Settings of a tracker of another author: whether its own report or also a colour histogram
    decides that the target is seen (`judge`), the least confidence of a seen target, whether the
    size of its boxes is used, and the longest waits for the answer to a picture (`timeout`) and for
    the first answer (`loading`) [s].
    """

    needs = frozenset({Channel.PICTURE})

    judge: Literal["own", "histogram"] = "own"
    """Who decides whether the target is seen: the tracker's "own" word, or also our colour
    "histogram" in its box."""
    least_confidence: Share = 0.0
    """The target also counts as not seen where the tracker reports a smaller confidence."""
    follow_size: bool = True
    """Use the size that the tracker reports, if the tracker declares that it measures the size, or
    if it declares nothing, once the reported size has changed."""
    timeout: Limit = 30.0
    """Longest wait for the answer to a picture [s]."""
    loading: Limit = 120.0
    """Longest wait for the first answer, before which the tracker loads what it needs [s]; for a
    tracker in our own process also that for its start on the first picture."""

    def guest(self, seed: int) -> Guest:
        """Return a new tracker of the other author, loaded and ready for the first picture;
        subclasses define this method.

        Args:
            seed: Seed of all random numbers of the tracker.

        Raises:
            ValueError: The tracker cannot be loaded or started.
        """
        raise NotImplementedError

    def build(self, rng: np.random.Generator) -> "GuestTracker":
        """Return a new tracker with these settings. It starts the other author's tracker at the
        call of `start`, with a seed that it draws from `rng`.
        """
        return GuestTracker(self, rng)


@final
class GuestTracker:
    """A `tracking.types.Tracker` around a tracker of another author.

    Reported boxes or corners give centre and size of the state, reported angles or corners its
    rotation; the motion of the camera (`ego`) is not used. `rng` draws the seed of each tracker
    that `start` makes.
    """

    _guest: Guest = SET_BY_START

    def __init__(self, settings: GuestSettings, rng: np.random.Generator) -> None:
        """Prepare a tracker; each `start` makes a new tracker of the other author."""
        self._settings = settings
        self._rng = rng

    def start(self, frame: Frame, region: Region, state: State) -> None:
        """Make a new tracker of the other author, and start it on the first frame, in which the
        target is the rectangle `region` [px] at `state`.

        Raises:
            ValueError: The region is not valid, or the tracker cannot be made or refuses the
                region.
        """
        check_region(frame, region, state)
        self._guest = self._settings.guest(DRAWN["seed"](self._rng))
        self._guest.start(frame, region, state)
        self._gives = self._guest.gives
        given = exact_box(region, state, frame.image) if self._guest.cuts else None
        sizes = self._settings.follow_size
        self._placement = Placement(region, state, self._gives, sizes=sizes, given=given)
        self._loss = LossJudge(LIMITS)
        if self._settings.judge == "histogram":
            self._model = AppearanceSettings().model(frame.image, region, state)

    def update(self, frame: Frame, ego: Array | None = None) -> Estimate:
        """Return the estimate for the next frame from the other author's tracker's report; the last
        state where that tracker does not see the target.

        Args:
            frame: The next frame.
            ego: Not used.

        Raises:
            ValueError: The other tracker fails, its answer has an invalid form or value, or it
                reports no confidence though `least_confidence` is above 0.
        """
        report = self._guest.update(frame)
        place = self._placement
        if report.seen:
            place.follow(report)
        distance, status = self._judge(frame, report)
        is_tilt_seen = place.tilts if self._gives is None else "corners" in self._gives
        corners = report.corners is not None and is_tilt_seen
        return Estimate(
            place.state,
            unknown_covariance(),
            distance,
            status,
            follows=(place.turns, place.resizes),
            corners=place.corners if corners else None,
        )

    def _judge(self, frame: Frame, report: Report) -> tuple[float, Status]:
        """Return the target's distance, 0..1, and its status. Where the tracker sees the target
        with enough confidence, and a colour histogram judges, the distance is the histogram's. Else
        it is 1 - confidence or, without a confidence, 0 if the target is seen, and 1 if not.

        Raises:
            ValueError: The tracker reports no confidence, which `least_confidence` needs.
        """
        confidence = report.confidence
        distance = float(not report.seen) if confidence is None else 1.0 - confidence
        least = self._settings.least_confidence
        if confidence is None and least > 0 and report.seen:
            raise ValueError(
                f"the tracker reports no confidence, but least_confidence = {least:g} needs one: "
                "set least_confidence to 0"
            )
        if not report.seen or (confidence is not None and confidence < least):
            return distance, self._loss.judge(math.inf, frame.time)
        if self._settings.judge == "own":
            return distance, self._loss.judge(0.0, frame.time)
        state = self._placement.state
        image = self._model.label(frame.image)
        distance = float(self._model.distances(image, state.vector[None])[0])
        status = self._loss.judge(distance, frame.time)
        if status is Status.LOCKED:
            self._model.learn(image, state)
        return distance, status
