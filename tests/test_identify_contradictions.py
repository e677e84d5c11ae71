"""Logs that contradict themselves: another clock, another unit, too little, or a wrong reading."""

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pytest
from gear_log import gear_log

from servo.cli.identify_command import estimated
from servo.identify.doubts import _too_long, doubts
from servo.identify.fit import identify, jitter_of
from servo.identify.log import read
from servo.mistake import Mistake
from tracking.statistics.comparisons import Interval

COMMAND = "command_x_m_s"
JOINT = "joint_x_m"
ENCODER = "encoder_x_m"
WAIT = 0.0125
"""Shortest wait of the pictures [s]; the longest is 4 ms more."""


@pytest.fixture(scope="module")
def columns(tmp_path_factory):
    """A log of the slide x: 12 s, 45 ms of delay, 30 ms of lag, and arrivals after their stamps."""
    path = tmp_path_factory.mktemp("contradictions") / "log.csv"
    gear_log(path, joint="x_m", play=0.002, lag=0.03, noise=1e-4, factor=0.1, seconds=12.0)
    table = pyarrow.csv.read_csv(path)
    found = {name: table[name].to_numpy() for name in table.column_names}
    waits = WAIT + 0.004 * np.random.default_rng(1).random(len(found["time_s"]))
    return found | {"arrived_s": found["time_s"] + waits}


def written(folder, columns, **changes):
    path = folder / "log.csv"
    pyarrow.csv.write_csv(pa.table({**columns, **changes}), path)
    return path


def refused(folder, columns, **changes):
    with pytest.raises(Mistake) as caught:
        estimated(read(written(folder, columns, **changes)), "line")
    return str(caught.value).removeprefix(f"{folder / 'log.csv'}: ")


def unlike(ends, half):
    """Return the sentence about waits that are not uniform, by their ends and middle half [s]."""
    return (
        f"pictures arrive {ends} s after their stamps, half of them within {half} s; a simulated "
        "wait is uniform and independent of time, so arrived_s is not used: it has outliers, or its "
        "unit or clock is not that of time_s"
    )


CLOCKS = {
    "another clock": (
        lambda stamps, arrived: arrived + 37,
        "pictures arrive 37.0125 to 37.0165 s after their stamps, so arrived_s is of another clock, "
        "and the shortest wait, which is unknown, is not in latency_ms",
        0.004,
    ),
    "a clock that is behind": (
        lambda stamps, arrived: arrived - 0.05,
        "pictures arrive -0.0374918 to -0.0335008 s after their stamps, so arrived_s is of another clock, "
        "and the shortest wait, which is unknown, is not in latency_ms",
        0.004,
    ),
    "milliseconds": (
        lambda stamps, arrived: 1e3 * arrived,
        unlike("14.5473 to 11994.4", "5.99e+03"),
        None,
    ),
    "a clock that is fast": (
        lambda stamps, arrived: arrived + 1e-3 * stamps,
        unlike("0.0127002 to 0.0283949", "0.00617"),
        None,
    ),
    "one late picture": (
        lambda stamps, arrived: np.where(stamps == 5, stamps + 0.5, arrived),
        unlike("0.0125082 to 0.5", "0.00201"),
        None,
    ),
    "every twelfth picture late": (
        lambda stamps, arrived: arrived + np.where(np.arange(len(stamps)) % 12, 0.0, 0.8),
        unlike("0.0125082 to 0.816485", "0.00217"),
        None,
    ),
    "late pictures of all kinds": (
        lambda stamps, arrived: arrived + np.where(np.arange(len(stamps)) % 12, 0.0, stamps % 0.7),
        unlike("0.0125082 to 0.694811", "0.00217"),
        None,
    ),
    "a clock that is set and set back": (
        lambda stamps, arrived: arrived + np.where(abs(stamps - 6) < 3, 0.3, 0.0),
        unlike("0.0125233 to 0.316496", "0.3"),
        None,
    ),
    "a clock that swings": (
        lambda stamps, arrived: arrived - 0.05 * np.abs(stamps / 6 - 1) + 0.05,
        unlike("0.0132433 to 0.0660514", "0.0252"),
        None,
    ),
    "pictures in batches": (
        lambda stamps, arrived: 0.5 * np.ceil(arrived / 0.5),
        unlike("0.02 to 0.51", "0.25"),
        None,
    ),
    "few arrivals": (
        lambda stamps, arrived: np.where(stamps < 0.2, arrived, np.nan),
        "only 20 rows have arrived_s, and 40 are needed, so it is not used",
        None,
    ),
}


@pytest.mark.parametrize("name", CLOCKS)
def test_arrivals_of_another_clock_are_doubted_and_leave_the_delay(tmp_path, columns, name):
    """37 s more were a latency of 37 s; milliseconds were a jitter of hours."""
    change, sentence, jitter = CLOCKS[name]
    arrived = change(columns["time_s"], columns["arrived_s"])
    log = read(written(tmp_path, columns, arrived_s=arrived))
    found = identify(log, [1e-4])
    assert doubts(log, found, {}) == [sentence]
    assert found.transport == 0
    assert found.whole.delay.value == pytest.approx(0.045, abs=1e-3)
    assert (found.jitter and found.jitter.value) == (jitter and pytest.approx(jitter, rel=0.02))


def test_arrivals_of_the_clock_of_the_rows_are_not_doubted(tmp_path, columns):
    log = read(written(tmp_path, columns))
    found = identify(log, [1e-4])
    assert doubts(log, found, {}) == []
    assert found.transport == pytest.approx(WAIT, abs=1e-4)


def test_arrivals_that_are_slow_for_a_camera_are_doubted_and_used(tmp_path, columns):
    log = read(written(tmp_path, columns, arrived_s=columns["arrived_s"] + 0.3))
    assert (
        log.clock
        == "pictures arrive 0.313 s after their stamps or later: is arrived_s on the clock of time_s?"
    )
    assert log.transport.min() == pytest.approx(0.3 + WAIT, abs=1e-4)


@pytest.mark.parametrize("seed", range(20))
def test_uniform_waits_are_not_doubted(tmp_path, columns, seed):
    """The worst of them have few pictures, or stamps in milliseconds."""
    rng = np.random.default_rng(seed)
    stamps = columns["time_s"]
    waits = rng.uniform(0, 0.1) + rng.uniform(2e-4, 0.1) * rng.random(len(stamps))
    waits[rng.random(len(waits)) > rng.uniform(0.05, 1)] = np.nan
    waits = waits if seed % 2 else np.round(waits, 3)
    log = read(written(tmp_path, columns, arrived_s=stamps + waits))
    assert log.clock == ""
    assert np.ptp(log.transport) == pytest.approx(np.nanmax(waits) - np.nanmin(waits))


def test_the_sum_is_right_where_commands_and_arrivals_are_of_one_other_clock(tmp_path, columns):
    """The command is given as its picture arrives, which is 12.5 ms after the stamp of its row."""
    off = 0.05
    asked = columns["time_s"] - off
    log = read(
        written(tmp_path, columns, asked_s=asked, arrived_s=columns["arrived_s"] - WAIT - off)
    )
    found = identify(log, [1e-4])
    [sentence] = doubts(log, found, {})
    assert sentence.endswith(
        "so arrived_s and asked_s are of another clock than time_s; latency_ms is right if both are "
        "of the same"
    )
    assert found.whole.delay.value + found.transport == pytest.approx(0.045, abs=1e-3)


def test_commands_of_another_clock_are_refused(tmp_path, columns):
    assert refused(tmp_path, columns, asked_s=columns["time_s"] + 37) == (
        "asked_s is 37 s after time_s: record both with the same clock"
    )


def spiked(values, height):
    values = values.copy()
    values[700] += height
    return values


UNMOVED = "the encoder of x does not follow its joint's positions"
GEAR = (
    "divide its readings by the gear's ratio, with its sign, if the encoder turns before a gear, "
    "else correct the unit of the encoder's or of the joint's positions"
)
UNCERTAIN = (
    "the delay is too uncertain in this log: record more movements, such as steps of 0.2 to 0.6 s "
    "in both directions for 40 s"
)
WRONG = {
    "a reversed encoder": (
        lambda c: {ENCODER: -c[ENCODER]},
        "the encoder of x moves -1.01 times as far as its joint: correct the sign of the encoder's "
        "or of the joint's positions",
    ),
    "a dead encoder": (
        lambda c: {ENCODER: np.full(len(c[ENCODER]), 0.1)},
        f"{UNMOVED} from 0.01 to 6 s: remove the encoder's column from the log",
    ),
    "an encoder that dies": (
        lambda c: {ENCODER: np.where(c["time_s"] < 6, c[ENCODER], c[ENCODER][600])},
        f"{UNMOVED} from 6.01 to 11.99 s: remove the encoder's column from the log",
    ),
    "counts": (
        lambda c: {ENCODER: 4096 * c[ENCODER]},
        f"the encoder of x moves 4.12e+03 times as far as its joint: {GEAR}",
    ),
    "an encoder before a gear that reverses": (
        lambda c: {ENCODER: -50 * c[ENCODER]},
        f"the encoder of x moves -50.3 times as far as its joint: {GEAR}",
    ),
    "a spike": (
        lambda c: {JOINT: spiked(c[JOINT], 5.0)},
        "joint_x_m jumps by 5, to 5.00417, at time_s = 7, which no command explains: leave out the "
        "wrong rows",
    ),
    "a spike down": (
        lambda c: {JOINT: spiked(c[JOINT], -5.0)},
        "joint_x_m jumps by -5, to -4.99583, at time_s = 7, which no command explains: leave out the "
        "wrong rows",
    ),
    "a spike of the encoder": (
        lambda c: {ENCODER: spiked(c[ENCODER], 0.05)},
        "encoder_x_m jumps by 0.0503, to 0.0542648, at time_s = 7, which no command explains: leave out the "
        "wrong rows",
    ),
    "an encoder of another motion": (
        lambda c: {JOINT: c[ENCODER][np.random.default_rng(2).permutation(len(c[JOINT]))]},
        f"{UNMOVED} from 0.01 to 6 s: remove the encoder's column from the log",
    ),
    "positions for rates": (
        lambda c: {COMMAND: np.cumsum(c[COMMAND]) / 100},
        "x does not follow its commands with a delay and a lag of 0.5 s at most: leave the columns "
        "of x out, or correct them: commands must be rates",
    ),
    "a delay of 1 s": (
        lambda c: {name: np.append(np.zeros(100), c[name][:-100]) for name in (JOINT, ENCODER)},
        # The search ends at 0.5 s: which of the two the best fit there is depends on the processor.
        (
            UNCERTAIN,
            "x does not follow its commands with a delay and a lag of 0.5 s at most: leave ",
        ),
    ),
    "one movement": (
        lambda c: {
            COMMAND: np.where(c["time_s"] > 6, 0.03, 0.0),
            JOINT: 0.03 * np.clip(c["time_s"] - 6.1, 0, None),
            ENCODER: 0.03 * np.clip(c["time_s"] - 6.1, 0, None),
        },
        UNCERTAIN,
    ),
    "numbers that overflow": (
        lambda c: {JOINT: 1e300 * c[JOINT]},
        "at time_s = 1.07 joint_x_m is 1.26e+296; values should be from -1e+12 to 1e+12: correct or leave out this row",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_contradiction_is_a_sentence(tmp_path, columns, name):
    change, sentence = WRONG[name]
    assert refused(tmp_path, columns, **change(columns)).startswith(sentence)


def test_an_encoder_is_compared_where_there_is_one(tmp_path, columns):
    """Its readings end half-way, or those of the joint do: that is no contradiction."""
    first = columns["time_s"] < 6
    part = {ENCODER: np.where(first, columns[ENCODER], np.nan)}
    log = read(written(tmp_path, columns, **part))
    assert doubts(log, identify(log, [1e-4]), {}) == []
    part = {JOINT: np.where(first, columns[JOINT], np.nan)}
    log = read(written(tmp_path, columns, **part))
    assert doubts(log, identify(log, [1e-4]), {}) == []


def test_an_encoder_of_another_clock_is_doubted(tmp_path, columns):
    late = np.append(np.zeros(20), columns[ENCODER][:-20])
    log = read(written(tmp_path, columns, **{ENCODER: late}))
    [sentence] = doubts(log, identify(log, [1e-4]), {})
    assert sentence == "the encoder of x is 0.16 s or more behind its joint"


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_an_encoder_of_half_or_twice_its_joint_is_refused(tmp_path, columns, factor):
    assert refused(tmp_path, columns, **{ENCODER: factor * columns[ENCODER]}) == (
        f"the encoder of x moves {1.006 * factor:.3g} times as far as its joint: {GEAR}"
    )


@pytest.mark.parametrize(
    ("every", "sentence"),
    [
        (600, "this log has 2 positions of x; record at least 40, and more than one movement"),
        (100, "this log has 12 positions of x; record at least 40, and more than one movement"),
        (
            20,
            "the positions of x are 0.2 s apart, too far for delay and lag: record one every 0.1 s or more often",
        ),
    ],
)
def test_too_few_rows_are_refused(tmp_path, columns, every, sentence):
    """They gave a delay of 0 (0 to 390000) ms, and a gain of nan."""
    few = {name: values[::every] for name, values in columns.items()}
    assert refused(tmp_path, few) == sentence


def test_rows_at_10_hz_are_enough(tmp_path, columns):
    """Half of their stamps are 0.1 s and a rounding error apart: "0.1 s; delay needs 0.1"."""
    few = {name: values[::10] for name, values in columns.items()}
    few["time_s"] = 0.1 * np.arange(len(few["time_s"])) + 1e-6 * np.arange(len(few["time_s"]))
    [channel] = read(written(tmp_path, few)).channels
    assert np.median(np.diff(channel.moved.times)) > 0.1


def test_a_joint_that_never_moves_is_named(tmp_path, columns):
    still = {"command_y_m_s": columns[COMMAND], "joint_y_m": np.full(len(columns[COMMAND]), 0.3)}
    log = read(written(tmp_path, columns, **still))
    assert [channel.name for channel in log.channels] == ["x"]
    assert doubts(log, identify(log, [1e-4]), {}) == [
        "y is commanded to move, but its positions stay the same; y is left out"
    ]


def test_a_position_that_changes_by_rounding_only_does_not_move(tmp_path, columns):
    """A reading between two numbers of single precision was a motion of 30 nm."""
    near = np.array([0.3, np.nextafter(np.float32(0.3), np.float32(1))], np.float32)
    flickers = near[np.arange(len(columns[COMMAND])) // 7 % 2].astype(float)
    log = read(written(tmp_path, columns, command_y_m_s=columns[COMMAND], joint_y_m=flickers))
    assert log.still == ["y"]


def test_a_delay_at_the_end_of_the_search_is_not_printed_as_an_estimate():
    near = Interval(0.4999, 0.45, 0.5)
    assert list(_too_long("delay", near, near, 0.5)) == [
        "the delay may be above 500 ms, the longest that is searched"
    ]
    vague = Interval(0.5, 0.0, 0.5)
    with pytest.raises(Mistake, match=r"^the lag is too uncertain in this log: record "):
        list(_too_long("lag", vague, near, 0.5))


def test_settings_that_no_run_takes_are_refused(tmp_path, columns):
    large = {name: 1e4 * columns[name] for name in (COMMAND, JOINT, ENCODER)}
    assert refused(tmp_path, columns, **large) == (
        "--set robot.backlash=[2.03, 0.0, 0.0, 0.0, 0.0, 0.0]: robot.backlash.0 = 2.03: input should be less than or "
        "equal to 1"
    )


def test_positions_at_1_khz_are_averaged_to_5_ms(tmp_path):
    times, columns = fast(10)
    log = read(written(tmp_path, columns))
    [channel] = log.channels
    assert len(channel.moved.times) == 2000
    assert channel.moved.times[1] == pytest.approx(times[5:10].mean())
    assert channel.moved.values[1] == pytest.approx(columns[JOINT][5:10].mean())
    found = identify(log, [1e-4])
    assert found.whole.delay.value == pytest.approx(0.044, abs=1e-3)


def fast(seconds):
    """The times, and a log at 1 kHz of commands that are new in each row; 45 ms of delay."""
    rng = np.random.default_rng(4)
    times = np.arange(1000 * seconds) * 1e-3
    asked = np.repeat(rng.choice([-0.05, 0.0, 0.08, -0.03, 0.0], 3 * seconds), 400)[: len(times)]
    asked = asked + rng.normal(0, 1e-3, len(times))
    moved = 1e-3 * np.cumsum(np.append(np.zeros(45), asked)[: len(times)])
    noise = rng.normal(0, 1e-4, len(times))
    return times, {"time_s": times, COMMAND: asked, JOINT: moved + noise}


def test_the_width_of_a_jitter_is_in_the_interval_of_the_range_of_uniform_draws():
    """The range of n draws over the width is distributed as Beta(n - 1, 2); of 3 as 3 x^2 - 2 x^3."""
    found = jitter_of(np.array([0.010, 0.013, 0.014]))
    assert found.value == pytest.approx(0.004 * 4 / 2)
    for bound, share in ((found.low, 0.975), (found.high, 0.025)):
        x = 0.004 / bound
        assert 3 * x**2 - 2 * x**3 == pytest.approx(share)
    assert jitter_of(np.array([0.010, 0.013])) is None
