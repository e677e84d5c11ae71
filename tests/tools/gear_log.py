"""A log of a joint that is no simulated robot: a delay, a lag, and a gear with play behind it."""

import csv
from itertools import accumulate

import numpy as np

STEP = 1e-3
"""Interval of the computed motion [s]."""
PERIOD = 10
"""A row has so many of them."""


def gear_log(
    path,
    *,
    joint="yaw_rad",
    delay=0.045,
    lag=0.06,
    play=0.01,
    noise=2e-4,
    seconds=40.0,
    seed=0,
    command_factor=1.0,
    factor=1.0,
    has_joint=True,
):
    """Write a log of steps of 0.2 to 0.6 s and 0.2 to 0.5 rad/s, with stands between them.

    The rate follows its command with a time constant, exactly; the encoder is on the motor.
    """
    rng = np.random.default_rng(seed)
    times = np.arange(0, seconds, STEP * PERIOD)
    asked = np.zeros(len(times))
    begin, way = 1.0, 1
    while begin < seconds - 1.5:
        end = begin + rng.uniform(0.2, 0.6)
        asked[(times >= begin) & (times < end)] = way * rng.uniform(0.2, 0.5)
        begin, way = end + rng.uniform(0.3, 0.8), -way
    late = round(delay / STEP)
    driven = np.append(np.zeros(late), np.repeat(asked, PERIOD))[: len(times) * PERIOD]
    kept = np.exp(-STEP / lag)
    rates = np.array(
        [0.0, *accumulate(driven, lambda rate, to: to + kept * (rate - to), initial=0.0)]
    )
    rates = rates[1:-1]
    motor = np.append(0.0, np.cumsum(driven * STEP + (rates - driven) * lag * (1 - kept)))[:-1]
    moved = accumulate(
        motor, lambda at, to: min(max(at, to - play / 2), to + play / 2), initial=0.0
    )
    moved = np.array(list(moved))[1::PERIOD]
    encoder = motor[::PERIOD] + noise * rng.standard_normal(len(times))
    columns = {
        "time_s": times,
        f"command_{joint}_s": command_factor * factor * asked,
        f"encoder_{joint}": factor * encoder,
        f"joint_{joint}": factor * moved,
    }
    if not has_joint:
        del columns[f"joint_{joint}"]
    with path.open("w", newline="") as file:
        table = csv.writer(file)
        table.writerow(columns)
        table.writerows(zip(*(values.round(7) for values in columns.values()), strict=True))
