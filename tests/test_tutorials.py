"""The tutorials: each runs as it stands in an empty folder, draws its picture, says its number."""

import os
import re
import subprocess
import sys
from pathlib import Path

import cv2
import pytest

pytestmark = pytest.mark.processes
FOLDER = Path(__file__).parent / "tutorials"
SAYS = {
    "your_tracker": [
        (r"contract: (kept)", "kept"),
        (r"median flow holds the car within ([\d.]+) px, pf_ssd 0.35", (1.0, 4.0)),
    ],
    "your_robot_and_object": [(r"CONVERGED: within ([\d.]+) px rms", (0.0, 2.0))],
    "your_footage": [
        (r"pf_ssd: ([\d.]+) px rms where it sees the car", (0.0, 1.0)),
        (r"camshift: .* which is in (\d+) % of the pictures", (30.0, 70.0)),
    ],
    "your_control_law": [
        (r"line, proportional: ([\d.]+) px", (13.0, 16.0)),
        (r"line, proportional, integral: ([\d.]+) px", (0.0, 2.0)),
    ],
    "a_study_for_a_paper": [
        (r"lags by ([\d.]+) px at 0.08 m/s, theory 11.59 px", (10.5, 12.5)),
        (r"with one by ([\d.]+) px", (0.0, 1.0)),
    ],
    "a_real_robot": [
        (r"(no picture for 0.2 s)", "no picture for 0.2 s"),
        (r"followed within ([\d.]+) px", (0.0, 10.0)),
        (r"no picture: stopped after ([\d.]+) s", (0.05, 0.45)),
        (r"no command: stopped after ([\d.]+) s", (0.25, 0.45)),
    ],
}
"""What each prints: a number and its bounds, or words. The robot's clock does not wait for a busy
machine, so that its numbers vary."""


def test_every_tutorial_is_here():
    scripts = {path.stem for path in FOLDER.glob("*.py") if "# %%" in path.read_text()}
    assert scripts == SAYS.keys()


@pytest.mark.parametrize("name", SAYS)
def test_a_tutorial_says_its_number(name, tmp_path):
    environment = os.environ | {"SERVOBENCH_TUTORIALS": str(tmp_path), "MPLBACKEND": "agg"}
    done = subprocess.run(
        [sys.executable, FOLDER / f"{name}.py"],
        cwd=tmp_path,
        env=environment,
        text=True,
        capture_output=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    for pattern, expected in SAYS[name]:
        found = re.search(f"^.*{pattern}", done.stdout, re.MULTILINE)
        assert found, (pattern, done.stdout)
        if isinstance(expected, str):
            assert found[1] == expected
        else:
            low, high = expected
            assert low <= float(found[1]) <= high, found[0]
    assert min(cv2.imread(str(tmp_path / f"{name}.png")).shape[:2]) > 200
