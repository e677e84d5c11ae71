"""The table of steps: one column for each value, one evaluation for each quantity."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from servo.cli import run_command
from servo.controllers.ibvs import Ibvs
from servo.loop.episode import Episode
from servo.loop.step import Step
from servo.mistake import Mistake
from servo.output.run_folder import RunFolder, prepare
from servo.scenario.load import load


@pytest.mark.parametrize("count", [3, 8])
def test_a_controller_with_other_features_is_refused_and_not_cut(monkeypatch, tmp_path, count):
    right = Ibvs.command

    def other(self, *seen):
        command = right(self, *seen)
        return replace(command, trace=replace(command.trace, features=np.zeros(count)))

    monkeypatch.setattr(Ibvs, "command", other)
    with pytest.raises(Mistake) as refused:
        run_command.run_scenario("still", [], 0, tmp_path / "out", quiet=True, rerun=False)
    assert str(refused.value) == (
        "the table of steps has 4 columns for 'feature' (feature_xn_m, feature_yn_m, feature_an_m, "
        f"feature_theta_rad), but the controller gives {count} values: it has other features than "
        "the scenario"
    )


def test_each_quantity_is_evaluated_once_a_row(monkeypatch, tmp_path):
    asked = Counter()
    right = Step.target_motion_true.fget

    def counted(step):
        asked[step.frame.index] += 1
        return right(step)

    monkeypatch.setattr(Step, "target_motion_true", property(counted))
    changes = ["run.duration=0.2", "tracker.kind=frozen", "expect={}"]
    assert (
        run_command.run_scenario("still", changes, 0, tmp_path / "o", quiet=True, rerun=False) == 0
    )
    # Once for the table, and once for each of the plot's two curves.
    assert asked == dict.fromkeys(range(6), 3)


def test_two_runs_do_not_write_into_one_folder(tmp_path):
    with Episode(load("still", ["run.duration=0.2"])) as episode:
        first = RunFolder(tmp_path, episode, rerun=False)
        with pytest.raises(Mistake) as refused:
            RunFolder(tmp_path, episode, rerun=False)
        assert str(refused.value) == f"{tmp_path}: another run is writing into this folder"
        first.close()
    assert [path.name for path in tmp_path.iterdir()] == ["steps.parquet"]


def test_runs_that_begin_at_once_get_folders_of_their_own(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    assert [str(prepare(None, "still-0")) for _ in range(3)] == [
        "runs/still-0",
        "runs/still-0-2",
        "runs/still-0-3",
    ]
