"""A package from outside with six parts, installed beside the wheel, used without our sources."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from commands import one_by_one

pytestmark = pytest.mark.processes

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


GAINS = """
scenario = "mine.toml"
seeds = 1
[axes]
"controller.gain" = [1.0, 2.0]
"tracker.kind" = ["red", "init_update"]
[set]
run.duration = 0.3
"""
LINES = {
    "trackers": "list tracker",
    "red": "list red",
    "run": "run mine.toml --quiet --out out",
    "report": "report out",
    "check": "check mine.toml --workers 1",
    "slow": "check mine.toml --set controller.gain=0.1 --workers 1",
    "bench": "bench clutter --trackers red,servobench-pilot:init_update,frozen --seeds 1 "
    "--workers 1 --quiet --out bench",
    "sweep": "sweep gains.toml --workers 1 --out sweep --quiet",
}


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    folder = tmp_path_factory.mktemp("place")
    (folder / "mine.toml").write_text(SCENARIO)
    (folder / "gains.toml").write_text(GAINS)
    return folder


@pytest.fixture(scope="module")
def ended(beside, place):
    """Exit code, stdout and stderr of all commands, by name."""
    _, *found = one_by_one(LINES.values(), place, beside)
    return dict(zip(LINES, found, strict=True))


def test_its_kinds_are_listed_with_the_package_and_their_settings(ended):
    listed = [" ".join(line.split()) for line in ended["trackers"][1].splitlines()]
    assert "tracker red (servobench-pilot 0.3.0) Follows whatever is red." in listed
    said = "Template matching, as a class of OpenCV's convention."
    assert f"tracker init_update (servobench-pilot 0.3.0) {said}" in listed
    assert "tracker.least  90" in ended["red"][1]


def test_all_parts_run_from_a_file_and_are_reported(ended, place):
    assert ended["run"][::2] == [0, ""]
    report = json.loads((place / "out" / "report.json").read_text())
    kinds = {part: report["settings"][part]["kind"] for part in ("tracker", "target", "robot")}
    assert kinds == {"tracker": "red", "target": "cushion", "robot": "slow_gantry"}
    assert report["versions"]["servobench-pilot"] == "0.3.0"
    columns = pq.read_table(place / "out" / "steps.parquet").column_names
    assert [c for c in columns if c.startswith("error_xg")]
    assert ended["report"][::2] == [0, ""]
    assert "slow_gantry" in (place / "out" / "report.html").read_text()


def test_they_are_checked(ended):
    assert ended["check"][::2] == [0, ""]
    assert ended["slow"][0] == 1


def test_they_are_swept_by_a_worker(ended, place):
    assert ended["sweep"][::2] == [0, ""]
    rows = pq.read_table(place / "sweep" / "results.parquet").to_pylist()
    assert [row["tracker.kind"] for row in rows] == ["red", "init_update"] * 2
    assert {row["version_servobench_pilot"] for row in rows} == {"0.3.0"}


def test_they_are_benched(ended, place):
    assert ended["bench"][::2] == [0, ""]
    bench = json.loads((place / "bench" / "study.json").read_text())
    assert bench["versions"]["servobench-pilot"] == "0.3.0"
    assert bench["axes"]["tracker"] == ["red", "servobench-pilot:init_update", "frozen"]
