"""Checks whether a tracker works as servobench needs it to."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from servo.contracts import BrokenContract, require
from servo.testing._examples import FIRST, film, region_of
from servo.testing._subject import built, check_repetition, config_of, contract, raising
from sim.types import Frame, Image
from tracking.types import Estimate, Region, State, Status, Tracker

ODD = {"black": ((120, 160, 3), 0), "white": ((120, 160, 3), 255), "tiny": ((7, 9, 3), 0)}
"""Unusual pictures that any camera may deliver: their shapes and grey levels."""


@dataclass(frozen=True, slots=True)
class _Subject:
    """The tested tracker: its `Config`, and the appearance (H, W, 3) of a target that it follows;
    None: any target.
    """

    config: object
    picture: Image | None

    def film(self, count: int, gone_after: int | None = None) -> Iterator[Frame]:
        """Yield frames with the target, which may disappear at a frame; see `_examples.film`."""
        return film(count, gone_after, self.picture)

    def begun(self, first: Frame, tracker: Tracker | None = None) -> Tracker:
        """Start a tracker, a new one if none is given, on the first frame; return the tracker."""
        begun: Tracker = tracker or built("tracker", self.config)
        begun.start(first, region_of(self.picture), FIRST)
        return begun

    def track(self, frames: Iterable[Frame], tracker: Tracker | None = None) -> Iterator[Estimate]:
        """Start a tracker on the first of some frames, and yield its estimates for the others."""
        remaining = iter(frames)
        tracker = self.begun(next(remaining), tracker)
        for frame in remaining:
            yield tracker.update(frame, np.zeros(4))

    def states(self, tracker: Tracker) -> list[State]:
        """Return the states that a tracker estimates in the five frames after its start."""
        return [estimate.state for estimate in self.track(self.film(6), tracker)]


@contract
def check_tracker(tracker: object, picture: Image | None = None) -> None:
    """Check that a tracker works as `tracking.types.Tracker` requires: valid estimates; the same
    states for the same pictures; pictures that it neither changes nor keeps; a status other than
    LOCKED for a target that is gone; no exception for black, white or tiny pictures; and a
    ValueError for an empty region.

    Args:
        tracker: A settings class `Config` or its instance, the name of a shipped kind such as
            "kams", "module:Name", or a class that `tracking.wrap` accepts.
        picture: Appearance of the target, RGB (H, W, 3) of uint8, for a tracker that follows only
            some kind of target; None: a target of two colours.

    Raises:
        BrokenContract: The tracker breaks its contract; the message says what to change.
    """
    subject = _Subject(config_of("tracker", tracker), picture)
    _check_pictures_are_kept(subject)
    same = "the same pictures gave other states"
    check_repetition("tracker", subject.config, subject.states, same)
    _check_buffer(subject)
    _check_odd_pictures(subject)
    _check_loss(subject)
    _check_refusal(subject)


def _check_pictures_are_kept(subject: _Subject) -> None:
    """Check that a tracker leaves the arrays of the pictures that it is given unchanged."""
    try:
        list(subject.track(subject.film(6)))
    except ValueError as error:
        if "read-only" in str(error):
            raise BrokenContract("the tracker writes into frame.image; work on a copy") from error
        raise


def _check_buffer(subject: _Subject) -> None:
    """Check that a tracker copies what it keeps of a picture: cameras and decoders write the next
    picture into the same array.
    """

    def reused() -> Iterator[Frame]:
        buffer = np.empty((120, 160, 3), np.uint8)
        shown = Frame(buffer, 0.0, 0).image
        for frame in subject.film(6):
            buffer[:] = frame.image
            yield Frame(shown, frame.time, frame.index)
            buffer[:] = 0

    plain, other = (
        [e.state for e in subject.track(frames)] for frames in (subject.film(6), reused())
    )
    require(
        plain == other,
        "the states differ where the caller uses one buffer for all pictures; "
        "keep copies, and compare no arrays by identity",
    )


def _check_odd_pictures(subject: _Subject) -> None:
    """Check that a tracker raises no exception for black, white and tiny pictures."""
    for name, (size, level) in ODD.items():
        tracker = subject.begun(next(subject.film(1)))
        with raising(
            f"for a {name} picture of {size[1]} x {size[0]} px update should return the last state "
            "as LOST, but raised"
        ):
            for k in range(1, 4):
                tracker.update(Frame(np.full(size, level, np.uint8), k * 0.1, k), np.zeros(4))


def _check_loss(subject: _Subject) -> None:
    """Check that a tracker is no longer LOCKED two seconds after its target has disappeared."""
    *_, last = subject.track(subject.film(30, gone_after=8))
    require(
        last.status is not Status.LOCKED,
        "the status is LOCKED two seconds after the target has disappeared; a robot would go on "
        "moving: report UNSURE or LOST (a class with init and update: return False for the target "
        'is not seen, or set judge = "histogram")',
    )


def _check_refusal(subject: _Subject) -> None:
    """Check that a tracker raises a ValueError if it is started on a region of zero width."""
    tracker = built("tracker", subject.config)
    try:
        tracker.start(next(subject.film(1)), Region(0.0, 20.0), FIRST)
    except ValueError:
        return
    raise BrokenContract(
        "start accepted a region of 0 x 20 px; raise a ValueError, as "
        "tracking.types.check_region does"
    )
