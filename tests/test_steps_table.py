"""The table of steps: one column for each value, one evaluation for each quantity."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from servo.cli import run_command
from servo.controllers.ibvs import Ibvs
from servo.loop.episode import Episode
from servo.loop.step import Step
from servo.mistake import Mistake, Refused
from servo.output import sinks
from servo.output.run_folder import RunFolder, prepare
from servo.output.steps_table import STREAM, StepsTable
from servo.scenario.load import load
from servo.types import Prediction, Trace


@pytest.mark.parametrize("count", [3, 8])
def test_a_controller_with_other_features_is_refused_and_not_cut(monkeypatch, tmp_path, count):
    right = Ibvs.command

    def other(self, *seen):
        command = right(self, *seen)
        numbers = np.ones(count)
        trace = Trace(numbers, numbers, Prediction(*np.zeros((4, count))), numbers, numbers)
        return replace(command, trace=trace)

    monkeypatch.setattr(Ibvs, "command", other)
    with pytest.raises(Mistake) as refused:
        run_command.run("still", [], 0, tmp_path / "out", quiet=True, no_rerun=True)
    assert str(refused.value) == (
        f"controller 'ibvs': the trace has {count} features, but the scenario has 4: xn, yn, an, "
        "theta"
    )


@pytest.fixture(scope="module")
def late(tmp_path_factory):
    """The table of a run whose tracker needs 80 ms, as lists."""
    folder = tmp_path_factory.mktemp("late") / "out"
    changes = ["run.tracker_ms=80", "run.duration=1.5", "expect={}", "tracker.kind=kams"]
    assert run_command.run("circle", changes, 0, folder, quiet=True, no_rerun=True) == 0
    return pq.read_table(folder / "steps.parquet").to_pydict()


def test_each_quantity_is_evaluated_once_a_row(monkeypatch, tmp_path):
    asked = Counter()
    right = Step.target_motion_true.fget

    def counted(step):
        asked[step.frame.index] += 1
        return right(step)

    monkeypatch.setattr(Step, "target_motion_true", property(counted))
    changes = ["run.duration=0.2", "tracker.kind=frozen", "expect={}"]
    assert run_command.run("still", changes, 0, tmp_path / "o", quiet=True, no_rerun=True) == 0
    assert asked == dict.fromkeys(range(6), 1)


def test_a_row_names_the_picture_that_its_decision_is_of(late):
    """A tracker that needs 80 ms: everything it reports is true of an older frame."""
    picture = np.array(late["picture"])
    decided = np.array(late["decided"])
    assert not decided.all()
    assert np.array_equal(decided[1:], np.diff(picture) > 0)
    for part in ("x_px", "y_px", "theta_rad", "scale"):
        then = np.array(late[f"true_of_picture_{part}"])
        np.testing.assert_array_equal(then, np.array(late[f"true_{part}"])[picture])
    apart = [
        np.subtract(late[f"estimated_{axis}_px"], late[f"true_of_picture_{axis}_px"])
        for axis in "xy"
    ]
    np.testing.assert_allclose(np.hypot(*apart), late["tracking_error_px"], atol=1e-12)
    of_frame = np.subtract(late["estimated_x_px"], late["true_x_px"])
    assert np.abs(of_frame).max() > 1.5 * np.abs(apart[0]).max()
    repeated = np.array(late["command_vx_m_s"])[1:] == np.array(late["command_vx_m_s"])[:-1]
    assert repeated[~decided[1:]].all()


def test_a_row_has_poses_and_corners(late):
    for name, height in (("camera", 1.042), ("target", 0.0)):
        places = np.array([late[f"{name}_{axis}_m"] for axis in "xyz"]).T
        turns = np.array([late[f"{name}_q{part}"] for part in "wxyz"])
        np.testing.assert_allclose(places[:, 2], height, atol=0.02)
        np.testing.assert_allclose((turns**2).sum(axis=0), 1.0, atol=1e-12)
    np.testing.assert_allclose(late["camera_x_m"], late["joint_x_m"], atol=1e-3)
    for who in ("true", "estimated"):
        us = np.array([late[f"{who}_corner_u{i}_px"] for i in range(4)])
        np.testing.assert_allclose(us.mean(axis=0), late[f"{who}_x_px"], atol=0.3)


def test_an_innovation_has_the_units_of_the_error(late):
    def endings(prefix):
        return [name.removeprefix(prefix) for name in late if name.startswith(prefix)]

    assert endings("innovation_") == [
        name for name in endings("error_") if not name.startswith("ahead")
    ]


def test_two_runs_do_not_write_into_one_folder(tmp_path):
    with Episode(load("still", ["run.duration=0.2"])) as episode:
        first = RunFolder(tmp_path, episode, rerun=False)
        with pytest.raises(Mistake) as refused:
            RunFolder(tmp_path, episode, rerun=False)
        assert (
            str(refused.value)
            == f"{tmp_path}: another run is writing into this folder; choose another with --out"
        )
        first.close()
    assert [path.name for path in tmp_path.iterdir()] == ["steps.parquet"]


def test_a_folder_that_is_refused_for_another_reason_than_a_full_disk(tmp_path):
    gone = tmp_path / "gone"
    still = load("still", ["tracker.kind=frozen"])
    with Episode(still) as episode, pytest.raises(Refused) as refused:
        RunFolder(gone, episode, rerun=False)
    sentence = f"{gone / STREAM}: No such file or directory: choose another folder"
    assert str(refused.value) == sentence


def test_runs_that_begin_at_once_get_folders_of_their_own(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    assert [str(prepare(None, "still-0")) for _ in range(3)] == [
        "runs/still-0",
        "runs/still-0-2",
        "runs/still-0-3",
    ]


def test_a_slow_run_is_written_once_a_second_of_the_wall_clock(monkeypatch, tmp_path):
    """Five steps of 0.4 s each: a kill costs what was not in the stream yet."""
    clock = [0.0]
    monkeypatch.setattr(sinks.time, "monotonic", lambda: clock[0])
    rows = []
    with Episode(load("still", ["run.duration=0.2", "tracker.kind=frozen"])) as episode:
        table = StepsTable(tmp_path, episode)
        for _, step in zip(range(5), episode, strict=False):
            clock[0] += 0.4
            table.add(step)
            with pa.ipc.open_stream(str(tmp_path / STREAM)) as stream:
                rows.append(stream.read_all().num_rows)
        table.close()
    assert rows == [0, 0, 3, 3, 3]
    assert pq.read_table(tmp_path / "steps.parquet").num_rows == 5


def test_space_is_reserved_for_the_batches_of_a_run_at_a_tenth_of_real_time(monkeypatch, tmp_path):
    """Ten batches a simulated second; half a megabyte of it is for what is written afterwards."""
    clock = [0.0]
    monkeypatch.setattr(sinks.time, "monotonic", lambda: clock[0])
    with Episode(load("still", ["run.duration=8", "tracker.kind=frozen"])) as episode:
        table = StepsTable(tmp_path, episode)
        reserved = (tmp_path / STREAM).stat().st_size - (1 << 19)
        step = next(iter(episode))
        for _ in range(episode.frames):
            clock[0] += 0.34  # s, for a thirtieth of a simulated one
            table.add(step)
        with pa.OSFile(str(tmp_path / STREAM)) as file:
            assert pa.ipc.open_stream(file).read_all().num_rows >= 237
            assert file.tell() < reserved < 3 * file.tell()
        table.close()
