"""From the log of a robot that is not simulated: its gain, units, names and play behind the lag."""

import re
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from gear_log import gear_log

from servo.cli.main import app
from servo.identify.doubts import doubts
from servo.identify.fit import identify
from servo.identify.log import read
from servo.mistake import Mistake

SLIDE = {"joint": "x_m", "play": 0.002, "lag": 0.03, "noise": 1e-4, "factor": 0.1, "seconds": 20.0}
"""Of a gantry's slide: 0.02 to 0.05 m/s, 0.2 mm of play."""
PLAIN = "time_s,command_x_m_s,joint_x_m\n"


def run(path, *words):
    out = path.parent / "out"
    return CliRunner().invoke(app, ["identify", str(path), "--out", str(out), *words])


def covers(interval, true):
    return interval.low <= true <= interval.high


@pytest.mark.wide
@pytest.mark.parametrize(("play", "seed"), [(0.005, 2001), (0.01, 2002), (0.02, 2003)])
def test_play_behind_the_lag_moves_neither_delay_nor_lag(tmp_path, play, seed):
    """Without the play in this place the delay is 2 to 8 ms too long, and the play 12 % too wide."""
    gear_log(tmp_path / "log.csv", delay=0.045, lag=0.06, play=play, seed=seed, seconds=20.0)
    found = identify(read(tmp_path / "log.csv"), [1e-4])
    assert found.is_behind
    whole = found.whole
    pairs = [(whole.delay, 0.045), (whole.lag, 0.06), (whole.sum, 0.105), (found.play["yaw"], play)]
    assert all(covers(interval, true) for interval, true in pairs), pairs
    assert found.play["yaw"].value == pytest.approx(play, rel=0.02)
    assert whole.delay.value == pytest.approx(0.045, abs=5e-4)
    assert found.gain["yaw"].value == pytest.approx(1, abs=1e-3)


def test_the_whole_robot_is_said_as_a_user_measures_it_whatever_simulates_it(tmp_path):
    gear_log(tmp_path / "log.csv", **SLIDE)
    done = run(tmp_path / "log.csv")
    assert done.output.splitlines()[:2] == [
        "# the whole robot as one delay, 45.0 (43.0 to 47.0) ms, and one lag, 30.0 (28.0 to 32.0) "
        "ms; together 75.0 (73.0 to 77.0) ms",
        "# gain from command to motion: x 1.0000 (0.9977 to 1.0022); simulated drives have 1, less "
        "friction",
    ]
    assert "# x 0.000203 (0.000156 to 0.000249); not measured, so 0: y, z, yaw, pitch, roll" in (
        done.output
    )
    assert "\n# this play is behind the lag; a simulated one is before it\n" in done.output


@pytest.mark.wide
def test_intervals_reach_to_a_channel_that_differs_and_a_line_says_so(tmp_path):
    gear_log(tmp_path / "x.csv", **{**SLIDE, "has_joint": False})
    gear_log(tmp_path / "y.csv", **{**SLIDE, "has_joint": False, "joint": "y_m", "delay": 0.065})
    x, y = (read(tmp_path / f"{name}.csv") for name in "xy")
    log = replace(x, channels=[*x.channels, *y.channels])
    found = identify(log, [1e-4, 1e-4])
    assert covers(found.whole.delay, 0.045)
    assert covers(found.whole.delay, 0.065)
    assert covers(found.whole.sum, 0.075)
    assert covers(found.whole.sum, 0.095)
    [sentence] = doubts(log, found, {})
    assert re.sub(r"[\d.]+", lambda number: f"{float(number[0]):.0f}", sentence) == (
        "delay and lag together are 75 ms in x and 95 ms in y, each alone; no single delay and lag "
        "fit both, and the intervals contain both"
    )


@pytest.mark.wide
@pytest.mark.parametrize(
    ("factor", "gain", "wrong"), [(0.5, "2.0", "unit"), (57.3, "0.0", "unit"), (-1, "-1.0", "sign")]
)
def test_commands_of_another_unit_or_sign_are_refused(tmp_path, factor, gain, wrong):
    gear_log(tmp_path / "log.csv", **SLIDE, command_factor=factor)
    done = run(tmp_path / "log.csv")
    assert re.sub(r"(\.\d)\d+ \(.*\)", r"\1 (..)", str(done.exception)) == (
        f"x moves {gain} (..) times as far as commanded: the {wrong} of its commands or of its "
        "positions is wrong"
    )
    assert not (tmp_path / "out").exists()


def test_a_gain_that_is_not_one_is_a_doubt(tmp_path):
    gear_log(tmp_path / "log.csv", **SLIDE, command_factor=1.25)
    assert run(tmp_path / "log.csv").output.startswith(
        "# not to be trusted: x moves 0.8000 (0.7982 to 0.8018) times as far as commanded, and "
        "simulated drives move as far as commanded\n# the whole"
    )


@pytest.mark.parametrize(
    ("log", "asked", "play", "unit"),
    [
        (
            {**SLIDE, "factor": 100.0},
            "x is commanded to move at 46.7 m/s",
            "x has a play of 0.203 m",
            "millimetres",
        ),
        (
            {"factor": 57.3, "seconds": 20.0},
            "yaw is commanded to move at 26.8 rad/s",
            "yaw has a play of 0.573 rad",
            "degrees",
        ),
    ],
)
def test_positions_and_commands_of_another_unit_are_doubted(tmp_path, log, asked, play, unit):
    gear_log(tmp_path / "log.csv", **log)
    done = run(tmp_path / "log.csv")
    assert done.output.splitlines()[:2] == [
        f"# not to be trusted: {said}, which is implausible: are its columns in {unit}?"
        for said in (asked, play)
    ]


def test_names_of_joints_are_any_and_have_to_be_the_robots(tmp_path):
    gear_log(tmp_path / "log.csv", joint="base-yaw.1_rad", seconds=4.0)
    log = read(tmp_path / "log.csv")
    assert [channel.name for channel in log.channels] == ["base-yaw.1"]
    assert not log.unused
    assert str(run(tmp_path / "log.csv").exception) == (
        "the robot of 'line': there is no joint or component of the twist 'base-yaw.1'; there is x, y, "
        "z, yaw, pitch, roll, vx, vy, vz, wx, wy, wz"
    )
    gear_log(tmp_path / "log.csv", joint="x_rad", seconds=4.0)
    assert str(run(tmp_path / "log.csv").exception) == (
        "the robot of 'line' moves 'x' in m, not in rad: correct the unit in the column's name"
    )


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (
            "t [ms],Axis.Pos_mm\n0,1\n",
            "this log has no column time_s; a log needs time_s, command_NAME_m_s and joint_NAME_m, "
            "encoder_NAME_m or measured_NAME_m_s (_rad in place of _m for angles); this one has t [ms], "
            "Axis.Pos_mm",
        ),
        (
            "time_s;command_x_m_s;joint_x_m\n0,0;1,5;2,0\n",
            "cannot read this log: CSV parse error: Row #2: Expected 1 columns, got 4: 0,0;1,5;2,0; "
            "correct it, or save it again",
        ),
        (
            f"{PLAIN}0,1,2\n1,0,5,3\n",
            "cannot read this log: CSV parse error: Row #3: Expected 3 columns, got 4: 1,0,5,3; correct "
            "it, or save it again",
        ),
        (
            f"{PLAIN}0,1,2\n1,off,3\n",
            "command_x_m_s is not one column of numbers: Failed to parse string: 'off' as a scalar "
            "of type double; correct this column",
        ),
    ],
)
def test_what_cannot_be_read_is_named_with_its_line(tmp_path, text, sentence):
    path = tmp_path / "log.csv"
    path.write_text(text)
    with pytest.raises(Mistake) as caught:
        read(path)
    assert str(caught.value) == f"{path}: {sentence}"


@pytest.mark.parametrize("end", ["", "\0\0\0"])
def test_a_last_line_that_was_cut_is_left_out(tmp_path, end):
    path = tmp_path / "log.csv"
    gear_log(path, **SLIDE)
    whole = read(path)
    text = path.read_text()
    path.write_text(text[:-3] + end)
    cut = read(path)
    np.testing.assert_array_equal(cut.channels[0].moved.values, whole.channels[0].moved.values[:-1])
