"""Trackers, ours or of other authors, as a server offers them to a client: a report for each
picture.
"""

from typing import final

import numpy as np

from sim.kinds import PartConfig
from sim.types import Frame
from tracking.guests.guest import GuestSettings
from tracking.guests.report import DIGITS, Gives, Report, box_around, outline_of
from tracking.types import Region, State, Status, Tracker


@final
class Served:
    """A tracker, ours or of another author, that returns a report for each picture: whether it sees
    the target, and where. A server sends these reports to its client. `seed` is that of the
    tracker's random numbers.
    """

    def __init__(self, config: PartConfig[Tracker], seed: int) -> None:
        """Make the tracker, ready for the first picture.

        Args:
            config: Settings of the tracker.
            seed: Seed of its random numbers.

        Raises:
            ValueError: A tracker of another author cannot be loaded or started, or has settings
                that only have an effect in the client, which judges its reports.
        """
        if isinstance(config, GuestSettings):
            usual = GuestSettings
            judged = {
                "judge": config.judge != usual.judge,
                "least_confidence": config.least_confidence != usual.least_confidence,
                "follow_size": config.follow_size != usual.follow_size,
            }
            for name in (name for name, is_set in judged.items() if is_set):
                raise ValueError(f"{name} has no effect here: set it where the reports arrive")
        self._guest = config.guest(seed) if isinstance(config, GuestSettings) else None
        self._tracker = None if self._guest else config.build(np.random.default_rng(seed))
        self.gives: frozenset[Gives] | None = self._guest.gives if self._guest else None
        """What a tracker of another author declares that it measures; None for our trackers, and
        if it declares nothing: the reports show what is measured."""

    def start(self, frame: Frame, region: Region, state: State) -> None:
        """Start the tracker on the first picture, in which the target is the rectangle `region`
        [px] at `state`.

        Raises:
            ValueError: The tracker refuses the region or the picture.
        """
        self._region = region
        self.outline = region.corners(state)
        """Corners (4, 2) [px] of the target in the last picture or, of another author's tracker, in
        the last one in which it saw the target."""
        if self._tracker is not None:
            self._tracker.start(frame, region, state)
        elif self._guest is not None:
            self._guest.start(frame, region, state)

    def update(self, frame: Frame) -> Report:
        """Return a report of where the tracker finds its target in the next picture [px]; of our
        trackers, a target that is not LOCKED counts as not seen.

        The attribute `outline` then holds the target's corners (4, 2) [px]; of another author's
        tracker that does not see the target, those of the last picture in which it did.

        Raises:
            ValueError: A tracker of another author fails, or its answer is not valid.
        """
        report = self._report(frame)
        if self._guest is not None and report.seen:
            self.outline = outline_of(report)
        return report

    def _report(self, frame: Frame) -> Report:
        if self._guest is not None:
            return self._guest.update(frame)
        assert self._tracker is not None  # there is one of the two
        found = self._tracker.update(frame)
        confidence = 1.0 - found.distance
        self.outline = found.outline(self._region)
        if found.status is not Status.LOCKED:
            return Report(seen=False, confidence=confidence)
        if found.corners is not None:
            return Report(corners=found.corners.round(DIGITS), confidence=confidence)
        if not found.follows[0]:
            box = box_around(self.outline).round(DIGITS)
            return Report(box=box, confidence=confidence)
        state = found.state
        sides = np.array([self._region.width, self._region.height]) * state.scale
        box = np.concatenate([np.array([state.x, state.y]) - sides / 2, sides]).round(DIGITS)
        return Report(box=box, angle=state.theta, confidence=confidence)
