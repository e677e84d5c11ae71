"""Every script of servo/examples runs and prints what it says."""

import re
import runpy
from pathlib import Path

import matplotlib as mpl
import pytest

FOLDER = Path(__file__).parents[1] / "servo" / "examples"
SCRIPTS = sorted(path.stem for path in FOLDER.glob("[a-z]*.py"))
BOUNDS = {
    "delay_and_gain": {"latency.*\n +1 +": 0.5},
    "error_against_theory": {"gain 1: ": 23.6, "gain 4: ": 6.2},
    "eye_to_hand": {"at first, ": 0.1},
    "goal_picture": {"last picture: ": 3.0},
    "in_a_notebook": {r"servo_rms_px +": 30.0},
    "learn_in_an_environment": {"law alone: ": 45.0},
    "log_to_rerun": {},
    "own_features": {"CONVERGED, ": 1.5},
    "own_law": {"slow_law: CONVERGED, path ": 0.9, "ibvs: CONVERGED, path ": 0.9},
    "own_robot": {"CONVERGED, ": 2.0},
    "own_tracker": {"from the goal: ": 3.0},
    "pan_tilt": {r"no angle, no size\n": 1.0},
    "read_steps": {"pandas: ": 4.0, "polars: ": 2.0},
    "study_in_a_loop": {"kams: ": 1.0, "pf_ssd: ": 1.0, "cv_mean_shift: ": 6.0},
    "track_a_video": {"59 pictures, ": 1.0},
}
"""What a script prints before a number, and the most that this number may be."""


def test_every_script_has_its_bounds():
    assert list(BOUNDS) == SCRIPTS


@pytest.mark.parametrize("name", SCRIPTS)
def test_a_script_runs_and_prints_what_it_says(name, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    with mpl.rc_context({"backend": "agg"}):
        runpy.run_module(f"servo.examples.{name}", run_name="__main__")
    printed = capfd.readouterr().out
    assert printed
    for before, most in BOUNDS[name].items():
        found = re.search(rf"{before}(\d+\.?\d*)", printed)
        assert found, printed
        assert 0 < float(found[1]) <= most, printed
