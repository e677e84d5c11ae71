"""From a robot's log to the settings that simulate it."""

import json
import re
import shutil
import tomllib

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner
from foxglove import Channel, Context, open_mcap
from robot_log import write_log

from servo.cli.main import app
from servo.identify.drive import GRID, after_lag, after_play
from servo.identify.fit import identify
from servo.identify.log import read
from servo.mistake import Mistake
from servo.scenario.load import load

CHANGES = [
    "run.latency_ms=45",
    "run.jitter_ms=12",
    "robot.lag_ms=50",
    "robot.backlash=[0.004, 0.006, 0, 0, 0, 0]",
    "robot.encoder_noise=[0.0002, 0.0002, 0, 0, 0, 0]",
]
SERVOS = 0.0119, 0.0079
"""Of the gantry's slides [s]."""


@pytest.fixture(scope="module")
def logged(tmp_path_factory):
    path = tmp_path_factory.mktemp("identify") / "log.csv"
    return path, write_log(path, CHANGES, seed=2)


def run(*words):
    return CliRunner().invoke(app, ["identify", *map(str, words)])


@pytest.mark.wide
def test_the_intervals_cover_what_was_simulated(logged):
    path, delay = logged
    found = identify(read(path), SERVOS)
    pairs = [(found.delay, delay), (found.lag, 0.05), (found.jitter, 0.012)]
    pairs += [(found.play["x"], 0.004), (found.play["y"], 0.006)]
    pairs += [(found.noise["x"], 0.0002), (found.noise["y"], 0.0002)]
    assert all(interval.low <= true <= interval.high for interval, true in pairs), pairs
    assert found.delay.high - found.delay.low < 0.015
    assert found.lag.high - found.lag.low < 0.015
    assert found.play["x"].high - found.play["x"].low < 0.001
    assert 0 <= found.transport < 1e-4


@pytest.mark.wide
def test_the_lines_are_settings_and_a_picture_is_beside_them(logged, tmp_path):
    done = run(logged[0], "--out", tmp_path / "out")
    assert done.exit_code == 0, done.output
    text = (tmp_path / "out" / "robot.toml").read_text()
    assert done.output.startswith(text)
    table = tomllib.loads(text)
    changes = [f"{part}.{key}={value}" for part, of in table.items() for key, value in of.items()]
    assert len(changes) == 5
    scenario = load("line", changes)
    assert scenario.run.latency_ms % (1e3 / 120) == pytest.approx(0.5e3 / 120, abs=0.01)
    assert scenario.run.latency_ms == pytest.approx(45, abs=9)
    [after] = re.findall(r"drives take commands over every 8.333 ms, so these after (\S+) ms", text)
    assert float(after) == pytest.approx(scenario.run.latency_ms + 0.5e3 / 120, abs=0.01)
    assert scenario.robot.backlash[1] == pytest.approx(0.006, abs=3e-4)
    assert scenario.robot.backlash[2:] == (0.0,) * 4
    assert (tmp_path / "out" / "response.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.wide
def test_what_a_log_has_in_vain_is_named_and_the_drives_own_servo_too(logged, tmp_path):
    table = pyarrow.csv.read_csv(logged[0])
    names = ["joint_x" if name == "joint_x_m" else name for name in table.column_names]
    pyarrow.csv.write_csv(table.rename_columns(names), tmp_path / "log.csv")
    done = run(tmp_path / "log.csv", "--out", tmp_path / "out")
    assert done.output.endswith("unused columns (unknown names, or no numbers): joint_x\n")
    number = r"([\d.]+)"
    [before] = re.findall(rf"# a delay of {number} .* before the drive", done.output)
    [(after, own)] = re.findall(rf"lag_ms = {number} .*, which adds {number} ms", done.output)
    [whole] = re.findall(
        rf"one delay, {number} .* one lag, {number} .*; together {number} ", done.output
    )
    delay, lag, both = map(float, whole)
    whole = float(before) + float(after) + float(own)
    assert float(own) == pytest.approx(1e3 * np.mean(SERVOS), abs=0.15)
    assert delay + lag == pytest.approx(both, abs=0.2)
    assert both == pytest.approx(whole + 1e3 * GRID / 2, abs=2)


def test_the_formats_of_logs_are_read_alike(logged, tmp_path):
    table = pyarrow.csv.read_csv(logged[0])
    pq.write_table(table, tmp_path / "log.parquet")
    context = Context()
    with open_mcap(tmp_path / "log.mcap", context=context):
        rows = Channel("/robot", schema={"type": "object"}, context=context)
        for row in table.to_pylist():
            rows.log(json.dumps(row).encode(), log_time=int(1e9 * row["time_s"]))
    first, *others = (read(p) for p in (logged[0], *sorted(tmp_path.glob("log.*"))))
    assert [channel.name for channel in first.channels] == ["x", "y"]
    for other in others:
        assert [channel.name for channel in other.channels] == ["x", "y"]
        np.testing.assert_array_equal(
            other.channels[1].moved.values, first.channels[1].moved.values
        )
        np.testing.assert_array_equal(other.transport, first.transport)


@pytest.mark.wide
def test_what_a_table_of_steps_cannot_show_is_said(ran, tmp_path):
    """Also: a run of half a second is too short."""
    steps = pq.read_table(ran / "steps.parquet").to_pylist()
    rows = [row | {"time_s": k / 30, "frame": k, "picture": k} for k, row in enumerate(8 * steps)]
    pq.write_table(pa.Table.from_pylist(rows), tmp_path / "steps.parquet")
    done = run(tmp_path / "steps.parquet", "--out", tmp_path / "out")
    assert done.exit_code == 0, done.output
    kept = [line for line in done.output.splitlines() if line.startswith("# ")]
    assert [re.split("[:,]", line)[0] for line in kept if not line.startswith("# not to")] == [
        "# the whole robot as one delay",
        "# gain from command to motion",
        "# jitter_ms",
        "# backlash",
        "# encoder_noise",
    ]
    shutil.copy(ran / "steps.parquet", tmp_path / "short.parquet")
    with pytest.raises(Mistake, match=r"this log is 0.467 s long: record 2 to 600 s$"):
        read(tmp_path / "short.parquet")


def test_play_holds_the_joint_until_the_motor_has_gone_through_it():
    motor = np.array([0.0, 1.0, 3.0, 2.0, 1.0, 0.0, 0.5, 3.0])
    np.testing.assert_array_equal(after_play(motor, 2.0), [0.0, 0.0, 2.0, 2.0, 2.0, 1.0, 1.0, 2.0])
    assert after_play(motor, 0.0) is motor


def test_a_lag_follows_a_ramp_later_by_its_time_constant():
    times = np.arange(50) * GRID
    exact = times - 0.05 * (1 - np.exp(-times / 0.05))
    np.testing.assert_allclose(after_lag(times, 0.05), exact, atol=1e-12)


def test_a_lag_keeps_where_a_motion_begins():
    motion = 3.0 + np.sin(np.arange(50) / 10)
    np.testing.assert_allclose(
        after_lag(motion, 0.05) - 3.0, after_lag(motion - 3.0, 0.05), atol=1e-12
    )
    assert after_lag(motion, 0.0) is motion
    assert after_lag(motion, GRID / 21) is motion
