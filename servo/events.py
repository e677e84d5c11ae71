"""What happens in a run, in words: occluded, lost, found again, saturated."""

from __future__ import annotations

from enum import Enum

from servo.episode import Step
from tracking.types import Status


class Event(Enum):
    """Something worth a line in the log; each member carries its sentence."""

    OCCLUDED = "The target looks unlike itself: occluded, perhaps. The camera coasts."
    LOST = "The target is lost."
    FOUND = "The target is found again."
    SATURATED = "A limit slows the camera."
    FREE = "No limit slows the camera any more."


def events(before: Step | None, step: Step) -> list[Event]:
    """What is new in a step."""
    found: list[Event] = []
    then, now = before.estimate.status if before else Status.LOCKED, step.estimate.status
    if now is not then:
        found.append(
            {Status.UNSURE: Event.OCCLUDED, Status.LOST: Event.LOST, Status.LOCKED: Event.FOUND}[
                now
            ]
        )
    was = before is not None and _slowed(before)
    if _slowed(step) != was:
        found.append(Event.FREE if was else Event.SATURATED)
    return found


def _slowed(step: Step) -> bool:
    return step.limited or step.command.saturated
