"""Checks whether the motion in a robot's log follows its commands with their sign and their unit,
and after which delay.

The commands are rates. Their integral over half a second is compared with the motion over the half
second that is a delay later. So neither noise nor a drift counts, and a lag makes a gain a little
smaller.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pyarrow as pa

from servo.identify.drive import summed
from servo.identify.log import Log, LogChannel, Series
from servo.twin.verdict import MM, Finding, State
from sim.types import Array

COMMAND = "command_"
"""Beginning of the names of columns with commands."""
DELAYS = np.arange(0.0, 0.6, 0.02)
"""Delays that are tried [s]."""
SPAN = 0.5
"""Time over which commanded and measured motion are compared [s]."""
GRID = 0.02
"""Interval of the times at which they are compared [s]."""
LEAST = {"m": 2e-3, "rad": 5e-3}
"""Least root mean square of the motion commanded over `SPAN` that shows anything [m, rad]."""
ALIKE = 0.8
"""Least correlation of a motion with its command."""
NEAR = 0.6, 1.6
"""Gains between these are those of a robot that moves as far as commanded."""


@dataclass(frozen=True, slots=True)
class Follows:
    """How a channel (a joint, or a component of the hand's twist) follows its command after a
    delay: it moves `gain` times as far as commanded.
    """

    name: str
    gain: float
    likeness: float
    """Correlation of commanded and measured motion."""


def of_commands(log: Log) -> tuple[list[Finding], list[str]]:
    """Return rows of a pre-flight's table on how the motion in a log follows the commands, and the
    names of the mistakes that they show.

    Args:
        log: The log; for a log of poses, its motion is that of the hand.
    """
    moving = [each for each in log.channels if _is_asked(each)]
    if not moving:
        text = "the commands in the log are too small to show anything"
        return [Finding("commands", text, state=State.UNKNOWN)], []
    tries = [[_follows(each, each, delay) for each in moving] for delay in DELAYS]
    best = max(range(len(tries)), key=lambda i: sum(each.likeness**2 for each in tries[i]))
    found = tries[best]
    gains = ", ".join(f"{each.name} {each.gain:.2f}" for each in found)
    wrong = [row for each in found if (row := _wrong(each, moving, DELAYS[best])) is not None]
    if wrong:
        return wrong, [row.found for row in wrong]
    text = f"followed {MM * DELAYS[best]:.0f} ms later, times as far as commanded: {gains}"
    return [Finding("commands", text)], []


def has_commands(table: pa.Table) -> bool:
    """Return True if the table of a robot's log has a column of commands."""
    return any(name.startswith(COMMAND) for name in table.column_names)


def _is_asked(channel: LogChannel) -> bool:
    """Return True if a channel is commanded to move by more than what noise may be."""
    asked, _ = _motions(channel, channel, 0.0)
    return len(asked) > 1 and bool(np.sqrt(np.mean(asked**2)) > LEAST[channel.unit])


def _wrong(found: Follows, channels: Sequence[LogChannel], delay: float) -> Finding | None:
    """Return the row about a channel that does not follow its command; None if it does.

    Args:
        found: How the channel follows its command.
        channels: All channels that are commanded to move.
        delay: The delay after which they follow best [s].
    """
    name = found.name
    if abs(found.likeness) < ALIKE:
        own = next(each for each in channels if each.name == name)
        others = [_follows(each, own, delay) for each in channels if each is not own]
        near = max(others, key=lambda each: abs(each.likeness), default=None)
        text = f"{name} does not follow its command"
        if near is not None and abs(near.likeness) >= ALIKE:
            text += f", but that of {near.name}"
        change = (
            "correct the columns of commands: rates of joints, or a twist in the hand's frame "
            "(not in the camera's)"
        )
        return Finding("commands", text, change, State.WRONG)
    if NEAR[0] < found.gain < NEAR[1]:
        return None
    what = "sign" if NEAR[0] < -found.gain < NEAR[1] else "unit"
    text = f"{name} moves {found.gain:.3g} times as far as commanded"
    change = (
        f"correct the {what} of the commands of {name} where the driver makes them: the film "
        "agrees with the logged motion (to change the log alone does not change the robot)"
    )
    return Finding("commands", text, change, State.WRONG)


def _follows(commanded: LogChannel, moved: LogChannel, delay: float) -> Follows:
    """Return how one channel's motion follows the command of another one, or its own, after a delay
    [s].
    """
    asked, made = _motions(commanded, moved, delay)
    both = float(asked @ made)
    size = float(asked @ asked)
    norm = np.sqrt(size * float(made @ made))
    if not norm > 0:
        return Follows(commanded.name, 0.0, 0.0)
    return Follows(commanded.name, both / size, both / float(norm))


def _motions(commanded: LogChannel, moved: LogChannel, delay: float) -> tuple[Array, Array]:
    """Return the commanded and the measured motion (n,) [m or rad] over half seconds that end 20 ms
    apart; those of the commands are a delay [s] earlier.
    """
    motion = moved.moved
    asked = summed(commanded.command, motion.times[-1])
    begin = max(asked.times[0] + delay, motion.times[0]) + SPAN
    times = np.arange(begin, motion.times[-1], GRID)

    def over(whole: Series, late: float) -> Array:
        ends = np.interp(times - late, whole.times, whole.values)
        return ends - np.interp(times - late - SPAN, whole.times, whole.values)

    return over(asked, delay), over(motion, 0.0)
