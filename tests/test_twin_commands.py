"""Whether the motion in a log follows its commands, as rows of a pre-flight."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest

from servo.identify.log import log_of
from servo.twin.commands import has_commands, of_commands

TIMES = np.arange(0, 12, 0.02)
NAMES = "vx_m_s", "vy_m_s", "wz_rad_s"
LATE = 5
"""Rows after which a command is a motion; a measured rate is that of the interval before its row."""


def swings():
    """Smooth rates of three channels (n, 3)."""
    phases = np.array([0.0, 1.0, 2.0])
    return 0.1 * np.sin(TIMES[:, None] * (1.7, 2.3, 3.1) + phases) + 0.02 * np.cos(TIMES[:, None])


def rows(asked, made=None):
    """The rows about a log with commands, and motions that follow `made` after 100 ms."""
    made = np.roll(swings() if made is None else made, LATE, axis=0)
    made[:LATE] = 0.0
    columns = {"time_s": TIMES}
    columns |= {f"command_{name}": x for name, x in zip(NAMES, asked.T, strict=True)}
    columns |= {f"measured_{name}": x for name, x in zip(NAMES, made.T, strict=True)}
    return of_commands(log_of(pa.table(columns), Path("log.csv")))


def test_a_log_that_follows_its_commands_has_one_row():
    [row], mistakes = rows(swings())
    assert (row.what, row.change, row.is_good, mistakes) == ("commands", "", True, [])
    assert row.found == (
        "followed 80 ms later, times as far as commanded: vx 1.00, vy 1.00, wz 1.00"
    )


@pytest.mark.parametrize(
    ("factors", "found", "what"),
    [
        ((-1, 1, 1), "vx moves -1 times as far as commanded", "sign"),
        ((1, 1000, 1), "vy moves 0.001 times as far as commanded", "unit"),
        ((1, 1, 180 / np.pi), "wz moves 0.0175 times as far as commanded", "unit"),
    ],
)
def test_a_sign_or_a_unit_of_a_command_is_named(factors, found, what):
    [row], mistakes = rows(swings() * factors)
    assert (row.found, row.is_good, mistakes) == (found, False, [found])
    assert row.change == (
        f"correct the {what} of the commands of {found[:2]} where the driver makes them: the film "
        "agrees with the logged motion (to change the log alone does not change the robot)"
    )


def test_commands_in_each_others_columns_are_named():
    found, mistakes = rows(swings()[:, [1, 0, 2]])
    assert mistakes == [
        "vx does not follow its command, but that of vy",
        "vy does not follow its command, but that of vx",
    ]
    assert not any(row.is_good for row in found)


def test_commands_that_are_hardly_a_motion_are_not_judged():
    small = swings() * (0.01, 0.01, 0.01)
    [row], mistakes = rows(small, small)
    assert (row.found, mistakes) == (
        "the commands in the log are too small to show anything",
        [],
    )
    [row], _ = rows(swings() * (1, 1, -0.001))
    assert row.found == "followed 80 ms later, times as far as commanded: vx 1.00, vy 1.00"


def test_commands_are_columns_of_this_name():
    assert has_commands(pa.table({"time_s": [0.0], "command_vx_m_s": [0.1]}))
    assert not has_commands(pa.table({"time_s": [0.0], "hand_x_m": [0.1]}))
