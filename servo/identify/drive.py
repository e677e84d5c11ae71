"""The model of a robot's drive: the play (backlash) of its gear and its lag, as in the
simulator.
"""

from itertools import accumulate

import numpy as np
from scipy.signal import lfilter

from servo.identify.log import Series
from sim.types import Array

GRID = 2e-3
"""Interval of the modelled motion [s], about a step of the physics."""


def summed(rates: Series, until: float) -> Series:
    """Return the commanded motion [m, rad]: the integral of commanded rates over time, zero at the
    first command. Each command holds until the next one.

    Args:
        rates: The commands [m/s, rad/s].
        until: Time up to which the motion is wanted [s]; it ends 2 ms later, or 2 ms after the last
            command if that is later.
    """
    times = np.append(rates.times, max(until, rates.times[-1]) + GRID)
    return Series(times, np.concatenate([[0.0], np.cumsum(np.diff(times) * rates.values)]))


def after_play(motion: Array, play: float) -> Array:
    """Return a joint's positions (n,) behind a gear with play (backlash), from those of its motor.
    The joint begins in the middle of the play.

    Args:
        motion: Positions of the motor (n,) [m, rad].
        play: The whole play of the gear [m, rad].
    """
    if play == 0.0:
        return motion
    half = play / 2
    ends = np.append(np.flatnonzero(np.diff(np.sign(np.diff(motion)))) + 1, len(motion) - 1)
    # Between two turns of the motor the joint is pushed one way from its place at the first.
    places = accumulate(
        motion[ends].tolist(),
        lambda last, to: min(max(last, to - half), to + half),
        initial=float(motion[0]),
    )
    last = np.repeat(list(places)[:-1], np.diff(ends, prepend=-1))
    return np.clip(last, motion - half, motion + half)


def after_lag(motion: Array, lag: float) -> Array:
    """Return the positions (n,) of a drive that follows a motion with a first-order lag, beginning
    at rest in the first position.

    Args:
        motion: Positions to follow (n,) [m, rad], 2 ms apart, linear in between.
        lag: Time constant [s]; below 0.1 ms the motion is returned unchanged.
    """
    if lag < GRID / 20:
        return motion
    kept = np.exp(-GRID / lag)
    now = 1.0 - (1.0 - kept) * lag / GRID
    return motion[0] + lfilter([now, 1.0 - kept - now], [1.0, -kept], motion - motion[0])
