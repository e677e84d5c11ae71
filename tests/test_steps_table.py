"""The table of steps: one column for each value, one evaluation for each quantity."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from servo import commands
from servo.controllers.ibvs import Ibvs
from servo.mistake import Mistake
from servo.step import Step


@pytest.mark.parametrize("count", [3, 8])
def test_a_controller_with_other_features_is_refused_and_not_cut(monkeypatch, tmp_path, count):
    right = Ibvs.command

    def other(self, *seen):
        return replace(right(self, *seen), features=np.zeros(count))

    monkeypatch.setattr(Ibvs, "command", other)
    with pytest.raises(Mistake) as refused:
        commands.run_scenario("still", [], 0, tmp_path / "out", quiet=True, rerun=False)
    assert str(refused.value) == (
        "the table of steps has 4 columns for 'feature' (feature_xn, feature_yn, feature_an, "
        f"feature_theta_rad), but there are {count} values: a controller with other features "
        "cannot be logged"
    )


def test_each_quantity_is_evaluated_once_a_row(monkeypatch, tmp_path):
    asked = Counter()
    right = Step.target_motion_true.fget

    def counted(step):
        asked[step.frame.index] += 1
        return right(step)

    monkeypatch.setattr(Step, "target_motion_true", property(counted))
    changes = ["run.duration=0.2", "tracker.kind=frozen", "expect={}"]
    assert commands.run_scenario("still", changes, 0, tmp_path / "o", quiet=True, rerun=False) == 0
    # Once for the table, and once for each of the plot's two curves.
    assert asked == dict.fromkeys(range(6), 3)
