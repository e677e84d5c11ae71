"""The manual's examples of a user's own robot, target and camera, each run as it stands."""

import re
import shutil
from pathlib import Path

import pytest
from robot_files import urdf_arm

from servo.cli import run_command
from servo.loop.run_measures import Outcome

ROOT = Path(__file__).parents[1]
DUCK = ROOT / "scenes" / "targets" / "duck.obj"
MANUAL = (ROOT / "scenes" / "README.md").read_text()
SECTION = MANUAL.partition("### Your own parts in short\n")[2].partition("\n## ")[0]
BLOCKS = re.findall(r"^```toml\n(\[(\w+)\]\n.*?)^```$", SECTION, re.MULTILINE | re.DOTALL) + [
    # The camera's example is one line of prose.
    (f"[{table}]\n{line}\n", table)
    for table, line in re.findall(r"`\[(\w+)\] (\w+ = [^`]+)`", SECTION)
]
CALIBRATION = """
image_width: 320
image_height: 240
camera_name: mine
camera_matrix: {rows: 3, cols: 3, data: [280.0, 0.0, 161.5, 0.0, 281.0, 118.0, 0.0, 0.0, 1.0]}
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [-0.2, 0.05, 0.001, -0.001, 0.0]}
"""


def test_there_is_an_example_of_each():
    assert [part for _, part in BLOCKS] == ["robot", "target", "camera"]


@pytest.mark.parametrize("block", [pytest.param(b, id=part) for b, part in BLOCKS])
def test_an_example_runs_as_it_stands(block, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("my_arm.urdf").write_text(urdf_arm())
    shutil.copy(DUCK, "my_part.obj")
    Path("my_camera.yaml").write_text(CALIBRATION)
    Path("mine.toml").write_text(block)
    assert (
        run_command.run(
            "mine.toml", ["run.duration=2.4"], None, Path("out"), quiet=True, no_rerun=True
        )
        == 0
    )
    report = (tmp_path / "out" / "report.json").read_text()
    assert f'"outcome": "{Outcome.CONVERGED.name}"' in report
