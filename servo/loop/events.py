"""Events of a run, such as that the target is lost or found again, as sentences for the run's
log.
"""

from enum import Enum

from servo.loop.columns import Columns
from servo.loop.step import Step
from servo.types import Mode
from tracking.types import Status


class Event(Enum):
    """A change during a run that is worth a line in its log, such as that the target is lost; the
    value of each member is that line, a sentence.
    """

    OCCLUDED = "The target's appearance has changed: perhaps it is occluded."
    LOST = "The target is lost."
    FOUND = "The target is found again."
    DROPPED = "The camera delivered no picture."
    COASTING = Mode.COASTING.value
    HOLDING = Mode.HOLDING.value
    SEARCHING = Mode.SEARCHING.value
    SATURATED = "A limit slows the camera."
    FREE = "No limit slows the camera any more."
    SIZE_REFUSED = "The tracker's size changes more than camera and target can have moved."
    LEAVING = "The camera cannot keep the whole target in its view."


ENOUGH = 10
"""Pictures after which a size that never changed is not expected to change."""
PARTS = ("centre", "angle", "size")
"""Names of the three results of `certain`."""
STATUS = {Status.UNSURE: Event.OCCLUDED, Status.LOST: Event.LOST, Status.LOCKED: Event.FOUND}


def events(before: Step | None, step: Step) -> list[Event]:
    """Return the events of a step (one frame), by comparison with the step before: the tracker's
    status changes, the camera stops delivering pictures, the controller enters a mode other than
    SERVOING (not reported without a picture), a limit begins or ceases to slow the camera, the
    tracker's size begins to be refused, or the camera begins to be unable to keep the whole target
    in view. The list is empty if none of these happens.

    Args:
        before: The previous step; None for the first step, which is compared with a target that is
            tracked and a camera that no limit slows.
        step: The present step.
    """
    found: list[Event] = []
    if step.estimate.status is not (before.estimate.status if before else Status.LOCKED):
        found.append(STATUS[step.estimate.status])
    # A run begins LOCKED and servoing: neither is an event of its first step.
    did = before.command.mode if before else step.command.mode
    if not step.frame.fresh:
        if before is None or before.frame.fresh:
            found.append(Event.DROPPED)  # the camera always coasts meanwhile: no event of its own
    elif step.command.mode is not did and step.command.mode is not Mode.SERVOING:
        found.append(Event[step.command.mode.name])
    was = before is not None and _slowed(before)
    if _slowed(step) != was:
        found.append(Event.FREE if was else Event.SATURATED)
    if step.estimate.likely_scale and not (before and before.estimate.likely_scale):
        found.append(Event.SIZE_REFUSED)
    if step.command.violated and not (before and before.command.violated):
        found.append(Event.LEAVING)
    return found


def remarks_on_tracker(run: Columns, *, is_guest: bool = False) -> str:
    """Return sentences about a tracker's estimates that the control law did not use: in how many
    pictures centre, angle or size was too uncertain, and in how many the size had changed more than
    is possible. "" if there were none, or if the features are made of pixels, which need no
    tracker. The last sentence has no full stop.

    Args:
        run: The numbers of the run.
        is_guest: Whether the tracker is one of another author, whose boxes may never change their
            size: then one more sentence says so, if the size never changed in 10 pictures or more
            and a feature needs it.
    """
    last = run.final[-1]
    if last.goal_sight.picture is not None:
        return ""  # pixels are servoed
    found = [_uncertain(run), _refused_sizes(run), _missing_size(run) if is_guest else ""]
    return ". ".join(filter(None, found))


def _missing_size(run: Columns) -> str:
    """Return a sentence if the tracker reported boxes of one size in `ENOUGH` pictures or more, and
    some feature needs the size; else "".
    """
    count = int((run["seen"] & run["decided"]).sum())
    if count < ENOUGH or run["size_followed"].any() or not run.final[-1].needed[1]:
        return ""
    return (
        f"The tracker's boxes had one size in all of {count} pictures: the size was not servoed, "
        "and the camera's distance not controlled by it"
    )


def _refused_sizes(run: Columns) -> str:
    """Return a sentence that counts the pictures in which the tracker's size was refused; "" if
    there were none.
    """
    refused = run["size_refused"] & run["decided"]
    if not refused.any():
        return ""
    ended = " to the end" if refused[-1] else ""
    return (
        f"In {refused.sum()} of {len(run)} pictures{ended}, the tracker's size had changed more "
        "than camera and target can have moved: it was not servoed"
    )


def _uncertain(run: Columns) -> str:
    """Return a sentence that counts the pictures in which the tracker stated a centre, an angle or
    a size with a variance too large for servoing; "" if there were none.
    """
    last = run.final[-1]
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
