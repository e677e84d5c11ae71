"""The contract of a tracker."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from servo.testing._given import (
    FIRST,
    BrokenContract,
    built,
    config_of,
    contract,
    film,
    region_of,
    require,
)
from sim.types import Frame, Image
from tracking.trackers import KINDS as TRACKERS
from tracking.types import Estimate, Region, Status, Tracker

ODD = {"black": ((120, 160, 3), 0), "white": ((120, 160, 3), 255), "tiny": ((7, 9, 3), 0)}
"""Pictures that come from any camera sooner or later: size and grey level."""


@dataclass(frozen=True, slots=True)
class _Subject:
    config: Any
    picture: Image | None

    def film(self, count: int, gone_after: int | None = None) -> Iterator[Frame]:
        return film(count, gone_after, self.picture)

    def begun(self, first: Frame) -> Tracker:
        tracker = built(self.config, ("start", "update"))
        tracker.start(first, region_of(self.picture), FIRST)
        return tracker

    def track(self, frames: Iterable[Frame]) -> Iterator[Estimate]:
        remaining = iter(frames)
        tracker = self.begun(next(remaining))
        for frame in remaining:
            yield tracker.update(frame)


@contract
def check_tracker(tracker: Any, picture: Image | None = None) -> None:
    """Check that a tracker keeps the contract of `tracking.types.Tracker`.

    Args:
        tracker: Its `Config`, its kind, "module:Name", or a class that `tracking.wrap` takes.
        picture: What the target shows (H, W, 3), for a tracker that follows certain targets only.

    Raises:
        BrokenContract: It does not; the sentence says what to change.
    """
    subject = _Subject(config_of(TRACKERS, tracker), picture)
    _check_estimates(subject)
    _check_repetition(subject)
    _check_buffer(subject)
    _check_odd_pictures(subject)
    _check_loss(subject)
    _check_refusal(subject)


def _check_estimates(subject: _Subject) -> None:
    try:
        found = list(subject.track(subject.film(6)))
    except ValueError as error:
        if "read-only" in str(error):
            raise BrokenContract("it writes into frame.image; work on a copy") from error
        raise
    for e in found:
        _check_estimate(e)


def _check_estimate(e: Any) -> None:
    require(isinstance(e, Estimate), f"update returned {type(e).__name__}; return an Estimate")
    s = e.state
    finite = all(map(math.isfinite, (s.x, s.y, s.theta, s.scale)))
    require(finite and s.scale > 0, f"the state is {s}; its numbers must be finite, scale above 0")
    require(0 <= e.distance <= 1, f"the distance is {e.distance}; it goes from 0 to 1")
    require(isinstance(e.status, Status), f"the status is {e.status!r}; use tracking.types.Status")
    require(
        np.shape(e.covariance) == (4, 4),
        "the covariance is not (4, 4); a tracker without one gives unknown_covariance()",
    )
    variances = np.diag(e.covariance)
    require(np.all(~(variances < 0)), f"the variances are {variances}; none can be negative")
    if e.corners is not None:
        right = np.shape(e.corners) == (4, 2) and np.isfinite(e.corners).all()
        require(right, "the corners are not four points (4, 2) of finite numbers")


def _check_repetition(subject: _Subject) -> None:
    once, again = ([e.state for e in subject.track(subject.film(6))] for _ in range(2))
    require(
        once == again,
        "the same pictures gave other states the second time; draw random "
        "numbers from the generator given to build(rng) only",
    )


def _check_buffer(subject: _Subject) -> None:
    """Cameras and decoders write the next picture into the same array."""

    def reused() -> Iterator[Frame]:
        buffer = np.empty((120, 160, 3), np.uint8)
        for frame in subject.film(6):
            buffer[:] = frame.image
            yield Frame(buffer, frame.time, frame.index)
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
    for name, (size, level) in ODD.items():
        tracker = subject.begun(next(subject.film(1)))
        for k in range(1, 4):
            try:
                _check_estimate(tracker.update(Frame(np.full(size, level, np.uint8), k * 0.1, k)))
            except BrokenContract:
                raise
            except Exception as error:
                raise BrokenContract(
                    f"a {name} picture of {size[1]} x {size[0]} px made update raise "
                    f"{type(error).__name__}: {error}; return the last state as LOST instead"
                ) from error


def _check_loss(subject: _Subject) -> None:
    *_, last = subject.track(subject.film(30, gone_after=8))
    require(
        last.status is not Status.LOCKED,
        "the status is LOCKED two seconds after the target "
        "has gone; a robot would follow nothing: report UNSURE or LOST",
    )


def _check_refusal(subject: _Subject) -> None:
    tracker = built(subject.config, ("start", "update"))
    try:
        tracker.start(next(subject.film(1)), Region(0.0, 20.0), FIRST)
    except ValueError:
        return
    raise BrokenContract(
        "start took a region of 0 x 20 px; raise a ValueError, as tracking.types.check_region does"
    )
