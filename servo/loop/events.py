"""What happens in a run, in words: occluded, lost, searched, found again, saturated."""

from enum import Enum

from servo.loop.columns import Columns
from servo.loop.step import Step
from servo.types import Mode
from tracking.types import Status


class Event(Enum):
    """Something worth a line in the log; each member carries its sentence."""

    OCCLUDED = "The target's appearance has changed: perhaps it is occluded."
    LOST = "The target is lost."
    FOUND = "The target is found again."
    DROPPED = "The camera delivered no picture."
    COASTING = Mode.COASTING.value
    HOLDING = Mode.HOLDING.value
    SEARCHING = Mode.SEARCHING.value
    SATURATED = "A limit slows the camera."
    FREE = "No limit slows the camera any more."
    LEAVING = "The camera cannot keep the whole target in its view."


PARTS = ("centre", "angle", "size")
"""What a tracker may be uncertain of, as `certain` has it."""
STATUS = {Status.UNSURE: Event.OCCLUDED, Status.LOST: Event.LOST, Status.LOCKED: Event.FOUND}


def events(before: Step | None, step: Step) -> list[Event]:
    """Return what is new in a step."""
    found: list[Event] = []
    if step.estimate.status is not (before.estimate.status if before else Status.LOCKED):
        found.append(STATUS[step.estimate.status])
    did = before.command.mode if before else step.command.mode
    if not step.frame.fresh:
        if before is None or before.frame.fresh:
            found.append(Event.DROPPED)  # that the camera coasts meanwhile goes without saying
    elif step.command.mode is not did and step.command.mode is not Mode.SERVOING:
        found.append(Event[step.command.mode.name])
    was = before is not None and _slowed(before)
    if _slowed(step) != was:
        found.append(Event.FREE if was else Event.SATURATED)
    if step.command.violated and not (before and before.command.violated):
        found.append(Event.LEAVING)
    return found


def uncertain(run: Columns) -> str:
    """Return a sentence about what the tracker saw, but stated too uncertainly to be servoed; else
    nothing.
    """
    last = run.final[-1]
    if last.goal_sight.picture is not None:
        return ""  # pixels are servoed
    seen = run["seen"] & run["decided"]
    counts = (run["uncertain"][seen] & (True, *last.servoed)).sum(axis=0).tolist()
    parts = [f"{n} {name}s" for name, n in zip(PARTS, counts, strict=True) if n]
    if not parts:
        return ""
    return (
        f"Of {seen.sum()} pictures in which the tracker saw the target, it stated "
        f"{', '.join(parts)} too uncertainly to be servoed"
    )


def _slowed(step: Step) -> bool:
    return step.limited or step.command.saturated
