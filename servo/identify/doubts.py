"""Why what was identified is not to be trusted: a log's signs and units."""

from collections.abc import Mapping
from math import floor, inf, isfinite, log10

import numpy as np

from servo.identify.fit import Identified
from servo.identify.log import Channel, Log, Series
from servo.mistake import Mistake
from tracking.statistics.comparisons import Interval

REFUSED = 2 / 3, 3 / 2
"""A gain outside this is a wrong unit: no drive makes so little or so much of its command."""
DOUBTED = 0.9, 1.1
"""A gain outside this changes the loop by more than the intervals say."""
FAST = 3.0
"""A rate so many times the largest of the simulated robot's joint is implausible."""
FASTEST = {"m": 3.0, "rad": 10.0}
"""A larger rate of the camera, or of a joint without a limit, is implausible [m/s, rad/s]."""
LARGEST_PLAY = {"m": 0.05, "rad": 0.2}
"""A larger play is implausible [m, rad]: 11 degrees."""
MISSING = 0.02
"""Of the rows, if more are missing, intervals depend on when the commands in gaps were given."""
MISFIT = 5e-3
"""A motion that is farther from the modelled one than the way in this time [s] is another one; a
simulated drive that takes a command each 8 ms and has friction leaves half of it."""
MILLI = 1e3
MISTAKEN = {"m": "millimetres", "rad": "degrees"}


def doubts(log: Log, found: Identified, fastest: Mapping[str, float]) -> list[str]:
    """Return sentences why the settings are not to be trusted.

    Args:
        log: What was identified.
        found: What it shows.
        fastest: Largest rate of each joint of the simulated robot [m/s, rad/s].

    Raises:
        Mistake: A joint's motion is not that of its command: a sign or a unit is wrong.
    """
    sentences: list[str] = []
    if log.missing > MISSING:
        sentences.append(
            f"{100 * log.missing:.0f} % of the rows are missing, of one each "
            f"{MILLI * log.interval:.3g} ms, and so are their commands; one that changed in a gap "
            "is taken to have changed in its middle"
        )
    sums = sorted(found.whole.apart.items(), key=lambda pair: pair[1].value)
    (first, least), (last, most) = sums[0], sums[-1]
    if least.high < most.low:
        sentences.append(
            f"delay and lag together are {MILLI * least.value:.3g} ms in {first} and "
            f"{MILLI * most.value:.3g} ms in {last}, each alone; no one delay and lag fit both, "
            "and the intervals reach from one to the other"
        )
    else:
        for channel, modelled in zip(log.channels, found.modelled, strict=True):
            sentences += _misfit(channel, modelled, MISFIT + log.uncertain)
    for channel in log.channels:
        name, unit = channel.name, channel.unit
        gain = found.gain[name]
        moves = f"{name} moves {said(gain)} times what it is asked for"
        # Parts of a twist mix where joints differ, so a small one may move with another.
        if name in fastest and _outside(gain, REFUSED):
            wrong = "sign" if gain.value < 0 else "unit"
            raise Mistake(f"{moves}: the {wrong} of its commands or of its positions is wrong")
        if _outside(gain, DOUBTED):
            sentences.append(f"{moves}, and simulated drives move as they are asked")
        asked = float(abs(channel.command.values).max())
        limit = FAST * fastest.get(name, inf)
        limit = limit if isfinite(limit) else FASTEST[unit]
        if asked > limit:
            sentences.append(
                f"{name} is asked for {asked:.3g} {unit}/s, which is implausible: are its "
                f"columns in {MISTAKEN[unit]}?"
            )
        play = found.play.get(name)
        if play is not None and play.low > LARGEST_PLAY[unit]:
            sentences.append(
                f"{name} has a play of {play.value:.3g} {unit}, which is implausible: are its "
                f"columns in {MISTAKEN[unit]}?"
            )
    return sentences


def _outside(gain: Interval, limits: tuple[float, float]) -> bool:
    """Return True where a whole interval is less or more than the limits."""
    low, high = limits
    return gain.high < low or gain.low > high


def _misfit(channel: Channel, modelled: Series, most: float) -> list[str]:
    """Return a sentence where a motion is farther from the modelled one than in a time [s].

    The noise of the readings is that of their differences, so it is not counted. Measured rates
    are left out: their noise adds up in positions.
    """
    if not (channel.shows_play or len(channel.encoder.values)):
        return []
    error = channel.moved.values - modelled.values
    noise = np.sqrt(np.mean(np.diff(error) ** 2) / 2)
    beyond = np.sqrt(max(0.0, np.var(error) - noise**2))
    if beyond < most * np.std(channel.command.values):
        return []
    return [
        f"{channel.name} does not move as one delay, one lag and a play let it: it is {beyond:.2g} "
        f"{channel.unit} from the modelled motion (root mean square without noise), so its "
        "numbers, its play too, may be wrong by more than their intervals"
    ]


def said(interval: Interval, factor: float = 1.0) -> str:
    """A value with its interval, with two digits of the width of the interval."""
    numbers = [factor * each for each in (interval.value, interval.low, interval.high)]
    width = max(numbers) - min(numbers)
    digits = 1 - floor(log10(width)) if width > 0 else 6
    value, low, high = (f"{round(each, digits):.{max(0, digits)}f}" for each in numbers)
    return f"{value} ({low} to {high})"
