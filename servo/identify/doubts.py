"""Sentences about signs, units and motions in a robot's log that make estimates from the log
unreliable.
"""

from collections.abc import Iterator, Mapping
from math import floor, inf, isfinite, log10

import numpy as np

from servo.identify.fit import LONGEST, SLOWEST, Identified
from servo.identify.log import FEWEST, LEAST, SPARSEST, Log, LogChannel, Series
from servo.mistake import Mistake, check_rules
from sim.types import Array
from tracking.statistics.comparisons import Interval

REFUSED = 2 / 3, 3 / 2
"""Range of gains of real drives and encoders; a gain outside comes from a wrong unit, or an
encoder before a gear."""
DOUBTED = 0.9, 1.1
"""Range of gains in which the loop of a simulated drive is about the same."""
FAST = 3.0
"""Largest plausible rate, relative to the largest rate of the simulated robot's joint."""
FASTEST = {"m": 3.0, "rad": 10.0}
"""Largest plausible rate of the camera, or of a joint without a limit [m/s, rad/s]."""
VAGUE = 0.2
"""Largest width of a gain's interval, relative to the gain, at which a joint counts as following
its command."""
ALIKE = 0.5
"""Least correlation of an encoder with its joint, which play and noise do not reduce below this."""
PIECE = 4.0
"""Length of the pieces of a log in which an encoder is compared with its joint [s]."""
LATE = 0.05
"""Largest delay of an encoder behind its joint [s]; with play it leads."""
NEARLY = 0.99
"""Share of the longest delay or lag of the search from which on the true one may be longer."""
LARGEST_PLAY = {"m": 0.05, "rad": 0.2}
"""Largest plausible play [m, rad]; 0.2 rad are 11 degrees."""
MISSING = 0.02
"""Largest share of missing rows at which the unknown times of their commands do not matter."""
MISFIT = 5e-3
"""Largest distance of a motion from the modelled one, over the rms rate of its command [s]; a
simulated drive that takes a command each 8 ms and has friction leaves half of it."""
MILLI = 1e3
MISTAKEN = {"m": "millimetres", "rad": "degrees"}


def doubts(log: Log, found: Identified, fastest: Mapping[str, float]) -> list[str]:
    """Return a sentence for each reason why estimates of delay, lag, play and noise from a robot's
    log may be wrong.

    Args:
        log: The log.
        found: The estimates from the log.
        fastest: Largest rate of each joint of the simulated robot [m/s, rad/s], by name.

    Raises:
        Mistake: A joint does not follow its command, or follows it with another sign or unit; its
            encoder does not follow the joint, or follows it with another sign or unit; or the log
            does not determine delay or lag.
    """
    sentences = [log.clock] if log.clock else []
    apart = list(_disagreement(found))
    for channel, modelled in zip(log.channels, found.modelled, strict=True):
        name = channel.name
        sentences += _of_encoder(channel)
        # Components of a twist mix where joints differ, so a small one may move with another.
        sentences += _of_gain(name, found.gain[name], is_joint=name in fastest)
        sentences += _of_unit(channel, found.play.get(name), fastest)
        if not apart:
            sentences += _misfit(channel, modelled, MISFIT + log.uncertain)
    sentences += [
        f"{name} is commanded to move, but its positions stay the same; {name} is left out"
        for name in log.still
    ]
    sentences += _too_long("delay", found.delay, found.whole.delay, LONGEST)
    sentences += _too_long("lag", found.lag, found.whole.lag, SLOWEST)
    if log.missing > MISSING:
        sentences.append(
            f"{100 * log.missing:.0f} % of the rows (one each {MILLI * log.interval:.3g} ms) and "
            "of the commands are missing; a command that changed in a gap is taken to have changed "
            "in the middle of the gap"
        )
    return sentences + apart


def _disagreement(found: Identified) -> Iterator[str]:
    """Yield a sentence if the sum of delay and lag differs between joints (channels), so that one
    delay and one lag cannot fit all.
    """
    sums = sorted(found.whole.apart.items(), key=lambda pair: pair[1].value)
    (first, least), (last, most) = sums[0], sums[-1]
    if least.high < most.low:
        yield (
            f"delay and lag together are {MILLI * least.value:.3g} ms in {first} and "
            f"{MILLI * most.value:.3g} ms in {last}, each alone; no single delay and lag fit both, "
            "and the intervals contain both"
        )


def _too_long(what: str, own: Interval, whole: Interval, most: float) -> Iterator[str]:
    """Yield a sentence if a delay or lag is so near the end of the search that the true one may be
    longer.

    Args:
        what: "delay" or "lag".
        own: Its estimate without the drives' own servo.
        whole: Its estimate with the drives' own servo.
        most: Longest time of the search [s].

    Raises:
        Mistake: The wider of the two intervals is as wide as the search.
    """
    interval = max(own, whole, key=lambda each: each.high - each.low)
    if not interval.high - interval.low < most:
        raise Mistake(
            f"the {what} is too uncertain in this log: record more movements, such as steps of 0.2 "
            "to 0.6 s in both directions for 40 s"
        )
    if interval.value >= NEARLY * most:
        yield f"the {what} may be above {MILLI * most:.3g} ms, the longest that is searched"


def _of_gain(name: str, gain: Interval, *, is_joint: bool) -> Iterator[str]:
    """Yield a sentence if a channel (a joint, or a component of the camera's twist) does not move
    as far as commanded.

    Raises:
        Mistake: A joint does not follow its command, or follows it with another sign or unit.
    """
    is_sure = gain.high - gain.low < VAGUE * abs(gain.value)
    times = f"{name} moves {interval_text(gain)} times as far as commanded"
    wrong = "sign" if gain.value < 0 else "unit"
    check_rules(
        (
            is_joint and not (is_sure or gain.low <= 1 <= gain.high),
            f"{name} does not follow its commands with a delay and a lag of {LONGEST:g} s at most: "
            f"leave the columns of {name} out, or correct them: commands must be rates",
        ),
        (
            is_joint and _outside(gain, REFUSED),
            f"{times}: the {wrong} of its commands or of its positions is wrong",
        ),
    )
    if _outside(gain, DOUBTED):
        yield f"{times}, and simulated drives move as far as commanded"


def _of_unit(
    channel: LogChannel, play: Interval | None, fastest: Mapping[str, float]
) -> Iterator[str]:
    """Yield sentences if a channel's commanded rate or play is so large that its columns seem to
    be in another unit.
    """
    name, unit = channel.name, channel.unit
    asked = float(abs(channel.command.values).max())
    limit = FAST * fastest[name] if isfinite(fastest.get(name, inf)) else FASTEST[unit]
    question = f"which is implausible: are its columns in {MISTAKEN[unit]}?"
    if asked > limit:
        yield f"{name} is commanded to move at {asked:.3g} {unit}/s, {question}"
    if play is not None and play.low > LARGEST_PLAY[unit]:
        yield f"{name} has a play of {play.value:.3g} {unit}, {question}"


def _outside(gain: Interval, limits: tuple[float, float]) -> bool:
    """Return whether the whole interval of a gain is below or above the limits."""
    return gain.high < limits[0] or gain.low > limits[1]


def _correlation(first: Array, second: Array) -> float:
    """Return the correlation of two series (n,); 0 if the first is constant."""
    return float(np.corrcoef(first, second)[0, 1]) if np.ptp(first) > LEAST else 0.0


def _of_encoder(channel: LogChannel) -> Iterator[str]:
    """Yield a sentence if a motor's encoder reports a motion later than its joint makes it.

    Raises:
        Mistake: In a piece of the log the readings do not follow the joint's positions, or they
            have another sign or unit.
    """
    moved = channel.moved
    encoder = channel.encoder
    gaps = np.diff(moved.times, prepend=-inf, append=inf)
    known = gaps[np.searchsorted(moved.times, encoder.times)] < 2 * SPARSEST
    if not channel.shows_play or known.sum() < FEWEST:
        return
    times = encoder.times[known]
    read = encoder.values[known]
    joint = np.interp(times, moved.times, moved.values)
    pieces = np.array_split(np.arange(len(times)), max(1, int(np.ptp(times) // PIECE)))
    travel = max(np.ptp(joint[piece]) for piece in pieces)
    for piece in pieces:
        # Where a joint moves little, play and noise are most of its encoder's motion.
        is_moving = 2 * np.ptp(joint[piece]) > travel
        if is_moving and abs(_correlation(read[piece], joint[piece])) < ALIKE:
            begin, end = times[piece[[0, -1]]]
            raise Mistake(
                f"the encoder of {channel.name} does not follow its joint's positions from "
                f"{begin:.6g} to {end:.6g} s: remove the encoder's column from the log"
            )
    ratio = float(np.sign(_correlation(read, joint)) * np.std(read) / np.std(joint))
    if not REFUSED[0] < ratio < REFUSED[1]:
        remedy = "correct the sign of the encoder's or of the joint's positions"
        if not REFUSED[0] < abs(ratio) < REFUSED[1]:
            remedy = (
                "divide its readings by the gear's ratio, with its sign, if the encoder turns "
                "before a gear, else correct the unit of the encoder's or of the joint's positions"
            )
        raise Mistake(
            f"the encoder of {channel.name} moves {ratio:.3g} times as far as its joint: {remedy}"
        )
    rates = np.gradient(joint, times)
    late = rates @ (joint - read / ratio) / (rates @ rates)
    if late >= LATE:
        yield f"the encoder of {channel.name} is {late:.2g} s or more behind its joint"


def _misfit(channel: LogChannel, modelled: Series, most: float) -> Iterator[str]:
    """Yield a sentence if a channel (a joint, or a component of the camera's twist) moves
    otherwise than the model with the estimates does.

    The noise of the readings, estimated from consecutive differences, does not count. Measured
    rates are left out: their noise adds up in positions.

    Args:
        channel: The channel.
        modelled: Its modelled positions.
        most: Largest rms distance over the rms rate of the command [s].
    """
    error = channel.moved.values - modelled.values
    noise = np.sqrt(np.mean(np.diff(error) ** 2) / 2)
    beyond = np.sqrt(max(0.0, np.var(error) - noise**2))
    is_measured = channel.shows_play or len(channel.encoder.values) > 0
    if is_measured and beyond >= most * np.std(channel.command.values):
        yield (
            f"{channel.name} does not move as with one delay, one lag and a play: {channel.name} "
            f"is {beyond:.2g} {channel.unit} from the modelled motion (root mean square without "
            f"noise), so the estimates of {channel.name}, its play too, may be wrong by more than "
            "their intervals"
        )


def interval_text(interval: Interval, factor: float = 1.0) -> str:
    """Return "VALUE (LOW to HIGH)" of an interval times a factor, rounded to two significant digits
    of the interval's width.
    """
    numbers = [factor * each for each in (interval.value, interval.low, interval.high)]
    width = max(numbers) - min(numbers)
    digits = 1 - floor(log10(width)) if width > 0 else 6
    value, low, high = (f"{round(each, digits):.{max(0, digits)}f}" for each in numbers)
    return f"{value} ({low} to {high})"
