"""Why what was identified is not to be trusted: a log's signs and units."""

from collections.abc import Mapping, Sequence
from math import floor, inf, isfinite, log10

import numpy as np

from servo.identify.fit import LONGEST, SLOWEST, Identified
from servo.identify.log import FEWEST, LEAST, SPARSEST, Channel, Log, Series
from servo.mistake import Mistake
from sim.types import Array
from tracking.statistics.comparisons import Interval

REFUSED = 2 / 3, 3 / 2
"""A gain outside this is a wrong unit: no drive makes so little or so much of its command."""
DOUBTED = 0.9, 1.1
"""A gain outside this changes the loop by more than the intervals say."""
FAST = 3.0
"""A rate so many times the largest of the simulated robot's joint is implausible."""
FASTEST = {"m": 3.0, "rad": 10.0}
"""A larger rate of the camera, or of a joint without a limit, is implausible [m/s, rad/s]."""
ENCODED = 1 / 3, 3.0
"""Readings of an encoder that move less or more, relative to their joint, have another unit."""
VAGUE = 0.2
"""Largest width of a gain's interval, relative to the gain, where a motion is its command's."""
ALIKE = 0.5
"""Correlation of an encoder with its joint: play and noise leave more."""
PIECE = 4.0
"""Parts of a log [s] in which an encoder is compared with its joint: it may die or slip."""
LATE = 0.05
"""An encoder is no more than this [s] behind its joint; play lets it lead."""
FOLLOWS = 0.9
"""Positions that a command explains to this part, and"""
BETTER = 3.0
"""so many times better than its sum over time, are those that it asks for."""
SHIFTS = 26
"""Delays at which this is tried."""
NEARLY = 0.99
"""Of the longest delay or lag that is looked for: the true one may be longer."""
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
        Mistake: A joint's motion is not that of its command, or its readings are not those of its
            motion; or the log shows no delay or lag.
    """
    sentences = [log.clock] if log.clock else []
    for channel, modelled in zip(log.channels, found.modelled, strict=True):
        _check_meaning(channel, modelled)
        sentences += _check_encoder(channel)
        # Parts of a twist mix where joints differ, so a small one may move with another.
        if channel.name in fastest:
            _check_gain(channel.name, found.gain[channel.name])
    sentences += [
        f"{name} is asked to move, and its positions stay the same; it is left out"
        for name in log.still
    ]
    sentences += _too_long("delay", (found.delay, found.whole.delay), LONGEST)
    sentences += _too_long("lag", (found.lag, found.whole.lag), SLOWEST)
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
        sentences += _of_gain(channel.name, found.gain[channel.name])
        sentences += _of_unit(channel, found.play.get(channel.name), fastest)
    return sentences


def _too_long(what: str, intervals: Sequence[Interval], most: float) -> list[str]:
    """Return a sentence where a time is as long as any that is looked for."""
    interval = max(intervals, key=lambda each: each.high - each.low)
    if not interval.high - interval.low < most:
        raise Mistake(
            f"this log does not show the {what}, {said(interval, MILLI)} ms: it needs more "
            "movements, such as steps of 0.2 to 0.6 s in both directions for 40 s"
        )
    if interval.value < NEARLY * most:
        return []
    return [
        f"the {what} is {MILLI * most:.3g} ms, the longest that is looked for; it may be longer"
    ]


def _check_gain(name: str, gain: Interval) -> None:
    """Refuse the motion of a joint that is not that of its command."""
    is_sure = gain.high - gain.low < VAGUE * abs(gain.value)
    if not (is_sure or gain.low <= 1 <= gain.high):
        raise Mistake(
            f"{name} does not follow its commands with a delay and a lag of {LONGEST:g} s "
            "at most: leave its columns out"
        )
    if not _outside(gain, REFUSED):
        return
    wrong = "sign" if gain.value < 0 else "unit"
    raise Mistake(
        f"{name} moves {said(gain)} times what it is asked for: the {wrong} of its commands or of "
        "its positions is wrong"
    )


def _of_gain(name: str, gain: Interval) -> list[str]:
    """Return a sentence where a joint, or a part of a twist, does not move as it is asked."""
    if not _outside(gain, DOUBTED):
        return []
    return [
        f"{name} moves {said(gain)} times what it is asked for, and simulated drives move as they "
        "are asked"
    ]


def _of_unit(channel: Channel, play: Interval | None, fastest: Mapping[str, float]) -> list[str]:
    """Return sentences where a rate or a play is one of another unit."""
    name, unit = channel.name, channel.unit
    asked = float(abs(channel.command.values).max())
    limit = FAST * fastest.get(name, inf)
    limit = limit if isfinite(limit) else FASTEST[unit]
    question = f"which is implausible: are its columns in {MISTAKEN[unit]}?"
    sentences: list[str] = []
    if asked > limit:
        sentences.append(f"{name} is asked for {asked:.3g} {unit}/s, {question}")
    if play is not None and play.low > LARGEST_PLAY[unit]:
        sentences.append(f"{name} has a play of {play.value:.3g} {unit}, {question}")
    return sentences


def _outside(gain: Interval, limits: tuple[float, float]) -> bool:
    """Return True where a whole interval is less or more than the limits."""
    low, high = limits
    return gain.high < low or gain.low > high


def _check_meaning(channel: Channel, modelled: Series) -> None:
    """Refuse commands that are positions, or positions that are rates."""
    moved = channel.moved
    command = channel.command
    left = np.var(moved.values - modelled.values) / np.var(moved.values)
    for shift in np.linspace(0.0, LONGEST, SHIFTS):
        place = np.searchsorted(command.times, moved.times - shift, side="right") - 1
        held = command.values[np.maximum(place, 0)]
        explained = np.corrcoef(held, moved.values)[0, 1] ** 2 if np.ptp(held) > 0 else 0.0
        if explained > FOLLOWS and BETTER * (1 - explained) < left:
            raise Mistake(
                f"the positions of {channel.name} are proportional to its commands, not to their "
                "sum over time: commands should be rates, and positions positions"
            )


def _check_encoder(channel: Channel) -> list[str]:
    """Return sentences where an encoder moves otherwise than its joint.

    Raises:
        Mistake: Its readings, or those of a part of the log, are not those of its joint.
    """
    moved = channel.moved
    encoder = channel.encoder
    gaps = np.diff(moved.times, prepend=-inf, append=inf)
    known = gaps[np.searchsorted(moved.times, encoder.times)] < 2 * SPARSEST
    if not channel.shows_play or known.sum() < FEWEST:
        return []
    times = encoder.times[known]
    read = encoder.values[known]
    behind = np.interp(times, moved.times, moved.values)
    ratio = _compare(channel.name, times, behind, read)
    pieces = np.array_split(np.arange(len(times)), max(1, int(np.ptp(times) // PIECE)))
    ways = [np.ptp(behind[piece]) for piece in pieces]
    for piece, way in zip(pieces, ways, strict=True):
        # Where a joint moves little, play and noise are most of its encoder's motion.
        if 2 * way > max(ways):
            _compare(channel.name, times[piece], behind[piece], read[piece])
    sentences: list[str] = []
    if not REFUSED[0] < ratio < REFUSED[1]:
        sentences.append(
            f"the encoder of {channel.name} moves {ratio:.3g} times as far as its joint, and a "
            "simulated one as far as it"
        )
    rates = np.gradient(behind, times)
    if (late := rates @ (behind - read / ratio) / (rates @ rates)) > LATE:
        sentences.append(f"the encoder of {channel.name} is {late:.2g} s or more behind its joint")
    return sentences


def _compare(name: str, times: Array, moved: Array, read: Array) -> float:
    """Return how many times as far as their joint readings (n,) [m, rad] move at these times [s].

    Raises:
        Mistake: They are not those of the joint's motion.
    """
    alike = np.corrcoef(read, moved)[0, 1] if np.ptp(read) > LEAST else 0.0
    if abs(alike) < ALIKE:
        raise Mistake(
            f"the encoder of {name} does not move with its joint from {times[0]:.6g} to "
            f"{times[-1]:.6g} s: leave its column out"
        )
    ratio = float(np.sign(alike) * np.std(read) / np.std(moved))
    if not ENCODED[0] < ratio < ENCODED[1]:
        wrong = "sign" if ratio < 0 else "unit"
        raise Mistake(
            f"the encoder of {name} moves {ratio:.3g} times as far as its joint: the {wrong} of "
            "one of them is wrong"
        )
    return ratio


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
