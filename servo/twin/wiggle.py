"""The motion that a robot should play and record for a pre-flight (a comparison of its log with the
film of its camera): slow swings of all axes at once, each with frequencies of its own, from rest to
rest.
"""

import numpy as np

from sim.types import Array

SECONDS = 30.0
"""Length of the motion [s]."""
RATE = 50.0
"""Rate of the rows of a file [1/s]."""
SLOWEST = 0.2
FASTEST = 1.0
"""Frequencies of the swings [Hz]."""
SWINGS = 3
"""Swings of each axis."""
SPEED = {"m": 0.06, "rad": 0.12}
"""Largest rate of each swing [m/s, rad/s]; three of them move an axis by up to about 5 to 9 cm, or
6 to 10 deg, to each side."""
RAMP = 2.0
"""Time in which the motion grows and fades [s]."""


def swings(units: tuple[str, ...], times: Array, seed: int = 0, size: float = 1.0) -> Array:
    """Return the positions (n, k) [m, rad] of k axes that swing, zero at the first and the last
    time.

    Args:
        units: Unit of each of the k axes, "m" or "rad".
        times: The times (n,) in increasing order [s]; the motion fills them.
        seed: Seed of frequencies and phases.
        size: Factor on all positions.
    """
    rng = np.random.default_rng(seed)
    ends = np.minimum(times - times[0], times[-1] - times)
    envelope = np.sin(np.pi / 2 * np.clip(ends / RAMP, 0, 1)) ** 2
    axes = []
    for unit in units:
        # Frequencies of an axis are spread, those of different axes differ.
        frequencies = SLOWEST * (FASTEST / SLOWEST) ** (
            (np.arange(SWINGS) + rng.uniform(size=SWINGS)) / SWINGS
        )
        phases = rng.uniform(0, 2 * np.pi, SWINGS)
        turns = 2 * np.pi * frequencies
        each = np.sin(np.multiply.outer(times, turns) + phases) / turns
        axes.append(size * SPEED[unit] * envelope * each.sum(axis=1))
    return np.stack(axes, axis=1)


def rates(units: tuple[str, ...], seed: int = 0, size: float = 1.0) -> tuple[Array, Array]:
    """Return times (n,) [s], 20 ms apart over 30 s, and the rates (n, k) [m/s, rad/s] of k swinging
    axes, each to be held until the next time. The rates of each axis add up to zero, so that it
    ends where it began.

    Args:
        units: Unit of each of the k axes, "m" or "rad".
        seed: Seed of frequencies and phases.
        size: Factor on all rates.
    """
    times = np.arange(round(SECONDS * RATE) + 1) / RATE
    positions = swings(units, times, seed, size)
    return times, np.append(np.diff(positions, axis=0) * RATE, np.zeros((1, len(units))), axis=0)
