"""What the readings of a log show of themselves: noise, steps, gaps, and another kind of robot."""

from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pytest
from click.testing import CliRunner
from gear_log import gear_log
from scipy.signal import cont2discrete, lfilter

from servo.cli import identify_command
from servo.cli.main import app
from servo.identify import log
from servo.identify.doubts import doubts, interval_text
from servo.identify.fit import identify
from servo.identify.lines import lines
from servo.identify.log import read, table_in
from servo.mistake import Mistake
from tracking.statistics.comparisons import Interval

STEP = 1e-3
PERIOD = 10
"""A row has so many steps of the computed motion."""


def first_order(lag):
    return [1.0], [lag, 1.0]


def write(path, response, *, delay=0.03, noise=1e-4, step=0.0, stands=0.3, lost=0.0, name="x"):
    """Write a log of 20 s: pulses of 0.2 to 0.5 s, and stands of one to two times `stands`.

    `response` is a transfer function from the rate asked for to the rate.
    """
    rng = np.random.default_rng(3)
    times = np.arange(0, 20, STEP * PERIOD)
    asked = np.zeros(len(times))
    begin, way = 0.5, 1
    while begin < times[-1]:
        end = begin + rng.uniform(0.2, 0.5)
        asked[(times >= begin) & (times < end)] = way * rng.uniform(0.1, 0.3)
        begin, way = end + rng.uniform(1, 2) * stands, -way
    driven = np.repeat(asked, PERIOD)
    driven = np.append(np.zeros(round(delay / STEP)), driven)[: len(driven)]
    numerator, denominator, _ = cont2discrete(response, STEP)
    rates = lfilter(numerator[0], denominator, driven)
    positions = STEP * np.append(0.0, np.cumsum((rates[1:] + rates[:-1]) / 2))[::PERIOD]
    readings = positions + rng.normal(0, noise, (2, len(times)))
    encoder = np.rint(readings[1] / step) * step if step else readings[1]
    rows = np.stack([times, asked, readings[0], encoder], axis=1)
    head = f"time_s,command_{name}_m_s,joint_{name}_m,encoder_{name}_m"
    kept = rows[rng.random(len(times)) >= lost]
    np.savetxt(path, kept, delimiter=",", header=head, comments="", fmt="%.9g")


@pytest.fixture
def path(tmp_path):
    return tmp_path / "log.csv"


def covers(interval, true):
    return interval.low <= true <= interval.high


@pytest.mark.parametrize("lag", [0.02, 0.12, 0.2])
def test_the_end_of_a_motion_is_no_noise(path, lag):
    """With it the noise was stated as 3 to 6 times as large."""
    write(path, first_order(lag), noise=1e-5, stands=1.3)
    noise = identify(read(path), [1e-4]).noise["x"]
    assert covers(noise, 1e-5)
    assert noise.high < 1.2e-5


def test_where_rows_are_missing_intervals_cover_and_a_line_says_so(path):
    write(path, first_order(0.015), delay=0.118, lost=0.3)
    log = read(path)
    found = identify(log, [1e-4])
    whole = found.whole
    pairs = [(whole.delay, 0.118), (whole.lag, 0.015), (whole.sum, 0.133), (found.gain["x"], 1)]
    assert all(covers(interval, true) for interval, true in pairs), pairs
    assert doubts(log, found, {}) == [
        "30 % of the rows (one each 10 ms) and of the commands are missing; a command that changed "
        "in a gap is taken to have changed in the middle of the gap"
    ]


@pytest.mark.parametrize(("gone", "changed"), [(1, 1.995), (3, 1.985), (9, 1.955), (10, 2)])
def test_a_command_that_changed_in_a_gap_of_up_to_9_rows_changed_in_its_middle(path, gone, changed):
    """The command of the row at 2 s came at the stamp of a missing row or at its own."""
    time = np.arange(400) / 100
    kept = (time >= 2.0) | (time < 1.995 - gone / 100)
    columns = {"time_s": time, "command_x_m_s": (time >= 2.0) / 10, "joint_x_m": time / 20}
    pyarrow.csv.write_csv(pa.table(columns).filter(kept), path)
    (channel,) = read(path).channels
    assert channel.command.times[channel.command.values > 0][0] == pytest.approx(changed)


def test_no_row_is_missing_where_two_sources_write_at_their_own_times(path):
    write(path, first_order(0.05))
    head, *rows = path.read_text().splitlines()
    rows += [f"{0.0013 + k / 75:.6f},,," for k in range(1490)]
    path.write_text("\n".join([head, *sorted(rows, key=lambda row: float(row.split(",")[0])), ""]))
    log = read(path)
    assert log.missing == 0
    write(path, first_order(0.05))
    np.testing.assert_array_equal(log.channels[0].command.times, read(path).channels[0].moved.times)


def test_a_robot_that_is_no_delay_and_lag_is_doubted(path):
    write(path, ([144.0], [1.0, 12.0, 144.0]))
    log = read(path)
    [sentence] = doubts(log, identify(log, [1e-4]), {})
    assert sentence.startswith("x does not move as with one delay, one lag and a play: x is 0.0")
    write(path, first_order(0.083))
    log = read(path)
    assert doubts(log, identify(log, [1e-4]), {}) == []


@pytest.mark.wide
def test_a_play_is_that_of_its_own_joint(tmp_path):
    """With the delay and the lag of both joints, one that has no play got one of 5 mm."""
    write(tmp_path / "x.csv", first_order(0.08), delay=0.05, noise=2e-4)
    write(tmp_path / "y.csv", first_order(0.03), delay=0.11, noise=2e-4, name="y")
    x, y = (read(tmp_path / f"{name}.csv") for name in "xy")
    found = identify(replace(x, channels=[*x.channels, *y.channels]), [1e-4, 1e-4])
    assert found.play["x"].low == found.play["y"].low == 0


def test_a_play_that_may_be_none_is_none_and_nowhere(path):
    write(path, first_order(0.05))
    found = replace(identify(read(path), [1e-4]), is_behind=True)
    text = lines(found, ["x", "y"], 0.008, [])
    assert "\nbacklash = [0.0, 0.0]  # x 0.0000" in text
    assert "; not distinguished from 0, so 0: x; not measured, so 0: y\n" in text
    assert "behind the lag" not in text


def test_a_play_is_in_the_units_of_the_joint_where_its_gain_is_not_one(path):
    gear_log(path, play=0.02, command_factor=1.25, seconds=10.0)
    assert identify(read(path), [1e-4]).play["yaw"].value == pytest.approx(0.02, rel=0.02)


@pytest.mark.parametrize(
    ("interval", "text"),
    [
        ((0.96617, 0.96607, 0.96627), "0.96617 (0.96607 to 0.96627)"),
        ((45.04, 42.91, 47.17), "45.0 (42.9 to 47.2)"),
        ((1234.0, 1000.0, 1468.0), "1230 (1000 to 1470)"),
        ((0.5, 0.5, 0.5), "0.500000 (0.500000 to 0.500000)"),
    ],
)
def test_an_interval_has_two_digits_of_its_width(interval, text):
    assert interval_text(Interval(*interval)) == text


def test_an_encoder_that_reads_in_steps_has_a_step_and_no_noise_below_it(path):
    write(path, first_order(0.02), step=0.005, stands=0.5)
    found = identify(read(path), [1e-4])
    assert found.step["x"] == pytest.approx(0.005)
    assert found.noise["x"] == Interval(0.0, 0.0, pytest.approx(0.0025))
    assert (
        "encoder_step = [0.005, 0.0]  # all readings of x are multiples of it, so a noise below its "
        "half is not seen\n"
    ) in lines(found, ["x", "y"], 0.008, [])


@pytest.mark.parametrize(("noise", "steps"), [(1e-4, {"x": pytest.approx(1e-4)}), (1e-3, {})])
def test_noise_is_that_before_the_readings_are_rounded(path, noise, steps):
    """Digits far below the noise are no step of an encoder."""
    write(path, first_order(0.02), noise=noise, step=1e-4, stands=0.5)
    found = identify(read(path), [1e-4])
    assert found.step == steps
    assert covers(found.noise["x"], noise)


def test_a_line_shows_that_it_is_working(path, monkeypatch):
    shown = []
    monkeypatch.setattr(
        identify_command, "waiting", lambda console, text: nullcontext(shown.append(text))
    )
    gear_log(path, seconds=4.0)
    CliRunner().invoke(app, ["identify", str(path), "--out", str(path.parent / "out")])
    assert shown == ["estimating delay, lag, play and noise"]


@pytest.mark.parametrize(
    ("least", "most", "sentence"),
    [
        (0.0, 1.0, ""),
        (0.25, 1.0, ""),
        (0.2501, 1.0, "pictures arrive 0.25 s after their stamps or later: is arrived_s on the clock of time_s?"),
        (0.0, 1.001, "pictures arrive 0 to 1.001 s after their stamps, so arrived_s is of another clock, and the shortest wait, which is unknown, is not in latency_ms"),
    ],
)  # fmt: skip
def test_waits_from_0_to_a_quarter_of_a_second_and_up_to_a_second_are_plain(
    tmp_path, least, most, sentence
):
    """Rows at whole sixteenths of a second, so that waits are exact."""
    columns = {"time_s": np.arange(1, 201) / 16, "command_x_m_s": np.sin(np.arange(200) / 5)}
    columns |= {"joint_x_m": 0.1 * np.cos(np.arange(200) / 5)}
    waits = np.random.default_rng(0).permutation(np.linspace(least, most, 200))
    path = tmp_path / "log.csv"
    pyarrow.csv.write_csv(pa.table(columns | {"arrived_s": columns["time_s"] + waits}), path)
    assert read(path).clock == sentence


@pytest.mark.parametrize(("ratio", "is_used"), [(7.9, True), (8.1, False)])
def test_waits_are_used_if_their_range_is_at_most_8_times_that_of_their_middle_half(
    tmp_path, ratio, is_used
):
    waits = np.linspace(0, 0.04, 200)
    waits[-1] = ratio * np.subtract(*np.quantile(waits, (0.75, 0.25)))
    time = np.arange(200) / 16
    columns = {"time_s": time, "command_x_m_s": np.sin(3 * time), "joint_x_m": np.cos(3 * time)}
    path = tmp_path / "log.csv"
    arrived = time + np.random.default_rng(0).permutation(waits)
    pyarrow.csv.write_csv(pa.table(columns | {"arrived_s": arrived}), path)
    log = read(path)
    assert len(log.transport) == (200 if is_used else 0)
    assert (log.clock == "") is is_used


@pytest.mark.parametrize(("kept", "is_used"), [(0.62, True), (0.76, False)])
def test_waits_are_used_if_consecutive_ones_are_hardly_alike(tmp_path, kept, is_used):
    """Each wait keeps a part of the one before: their correlation is about this part."""
    rng = np.random.default_rng(0)
    waits = [0.02]
    for noise in rng.normal(0.0, 0.003, 1999):
        waits.append(0.02 + kept * (waits[-1] - 0.02) + noise)
    time = np.arange(2000) / 16
    columns = {"time_s": time, "command_x_m_s": np.sin(3 * time), "joint_x_m": np.cos(3 * time)}
    path = tmp_path / "log.csv"
    pyarrow.csv.write_csv(pa.table(columns | {"arrived_s": time + np.array(waits)}), path)
    assert (len(read(path).transport) > 0) is is_used


def test_a_log_of_more_than_a_gibibyte_is_not_read(tmp_path):
    path = tmp_path / "log.csv"
    with path.open("wb") as file:
        file.truncate((1 << 30) + 1)  # no block of the disk is written
    with pytest.raises(Mistake) as refused:
        table_in(path)
    assert str(refused.value) == (
        f"{path}: cannot read this log: it is too large; the limit is 1,073,741,824 bytes"
    )


def test_a_command_whose_picture_is_not_in_the_log_has_no_stamp():
    columns = {
        "time_s": np.array([0.0, 0.1, 0.2, 0.3]),
        "frame": np.arange(4.0),
        "picture": np.array([0.0, np.nan, 9.0, 2.0]),
        "age_s": np.full(4, 0.05),
        "decided": np.ones(4),
    }
    made, waited = log._pictures(columns, np.zeros(4))
    np.testing.assert_allclose(made, [0.05, np.nan, np.nan, 0.25])
    np.testing.assert_allclose(waited, [0.05, np.nan, np.nan, 0.05])


@pytest.mark.parametrize("gone", [1, 700])
def test_a_row_without_a_measured_rate_leaves_the_others(path, gone):
    """A rate is the mean since the last row that has one."""
    time = np.arange(1500) / 100
    rates = 0.1 * np.sin(time)
    columns = {"time_s": time, "command_x_m_s": np.sign(np.sin(time)), "measured_x_m_s": rates}
    whole = pa.table(columns)
    pyarrow.csv.write_csv(whole, path)
    (complete,) = read(path).channels
    rates[gone] = np.nan
    columns["measured_x_m_s"] = pa.array(rates, from_pandas=True)
    pyarrow.csv.write_csv(pa.table(columns), path)
    (found,) = read(path).channels
    assert found.moved.times[-1] == pytest.approx(complete.moved.times[-1])
    assert np.ptp(found.moved.values) == pytest.approx(np.ptp(complete.moved.values), rel=0.02)
