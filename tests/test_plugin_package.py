"""A package from outside with six parts, installed beside the wheel, used without our sources."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pyarrow.parquet as pq
import pytest

PILOT = Path(__file__).parent / "data" / "pilot"
SCENARIO = """
[run]
duration = 2.0
[robot]
kind = "slow_gantry"
[target]
kind = "cushion"
[motion]
kind = "swing"
[tracker]
kind = "red"
[features]
kind = "centre"
[estimator]
kind = "none"
[controller]
kind = "straight"
[expect]
outcome = "CONVERGED"
servo_peak_px = 10.0
"""


@pytest.fixture(scope="module")
def beside(installed, tmp_path_factory, pip):
    """The folder of an installation of ours and of the pilot's package."""
    folder = tmp_path_factory.mktemp("pilot")
    shutil.copytree(PILOT, folder / "source")
    dist = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    subprocess.run(dist, cwd=folder / "source", check=True, capture_output=True)
    (wheel,) = folder.glob("*.whl")
    shutil.copytree(installed, folder / "both")
    pip("--target", str(folder / "both"), str(wheel))
    return folder / "both"


@pytest.fixture
def call(beside, tmp_path):
    (tmp_path / "mine.toml").write_text(SCENARIO)

    def run(*arguments):
        code = "from servo.cli.main import main; main()"
        return subprocess.run(
            [sys.executable, "-c", code, *arguments], cwd=tmp_path, capture_output=True, text=True,
            check=False, env=os.environ | {"PYTHONPATH": str(beside), "COLUMNS": "200"},
        )  # fmt: skip

    return run


def test_its_kinds_are_listed_with_the_package_and_their_settings(call):
    listed = [" ".join(line.split()) for line in call("list", "tracker").stdout.splitlines()]
    assert "tracker red (servobench-pilot 0.3.0) Follows whatever is red." in listed
    said = "Template matching, as a class of OpenCV's convention."
    assert f"tracker init_update (servobench-pilot 0.3.0) {said}" in listed
    assert "tracker.least  90" in call("list", "red").stdout


def test_all_parts_run_from_a_file_and_are_reported(call, tmp_path):
    ended = call("run", "mine.toml", "--quiet", "--out", "out")
    assert (ended.returncode, ended.stderr) == (0, "")
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    kinds = {part: report["settings"][part]["kind"] for part in ("tracker", "target", "robot")}
    assert kinds == {"tracker": "red", "target": "cushion", "robot": "slow_gantry"}
    assert report["versions"]["servobench-pilot"] == "0.3.0"
    columns = pq.read_table(tmp_path / "out" / "steps.parquet").column_names
    assert [c for c in columns if c.startswith("error_xg")]
    page = call("report", "out")
    assert (page.returncode, page.stderr) == (0, "")
    assert "slow_gantry" in (tmp_path / "out" / "report.html").read_text()


def test_they_are_checked(call):
    ended = call("check", "mine.toml", "--workers", "1")
    assert (ended.returncode, ended.stderr) == (0, "")
    missed = call("check", "mine.toml", "--set", "controller.gain=0.1", "--workers", "1")
    assert missed.returncode == 1


def test_they_are_swept_over_two_workers(call, tmp_path):
    (tmp_path / "gains.toml").write_text(
        'scenario = "mine.toml"\nseeds = 1\n[axes]\n"controller.gain" = [1.0, 2.0]\n'
        '"tracker.kind" = ["red", "init_update"]\n[set]\nrun.duration = 0.3\n'
    )
    ended = call("sweep", "gains.toml", "--workers", "2", "--out", "sweep", "--quiet")
    assert (ended.returncode, ended.stderr) == (0, "")
    rows = pq.read_table(tmp_path / "sweep" / "results.parquet").to_pylist()
    assert [row["tracker.kind"] for row in rows] == ["red", "init_update"] * 2
    assert {row["version_servobench_pilot"] for row in rows} == {"0.3.0"}


def test_they_are_benched(call, tmp_path):
    ended = call("bench", "clutter", "--trackers", "red,servobench-pilot:init_update,frozen",
                 "--seeds", "1", "--workers", "1", "--quiet", "--out", "bench")  # fmt: skip
    assert (ended.returncode, ended.stderr) == (0, "")
    bench = json.loads((tmp_path / "bench" / "bench.json").read_text())
    assert bench["versions"]["servobench-pilot"] == "0.3.0"
    assert {"red", "servobench-pilot:init_update", "frozen"} == {
        r["tracker"] for r in bench["runs"]
    }
