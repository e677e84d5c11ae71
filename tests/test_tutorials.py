"""The tutorials: the code of each page runs in an empty folder and prints the page's numbers."""

import os
import re
from pathlib import Path

import cv2
import pytest
from preloaded import SCRIPT, on_path, ran
from tutorial_pages import saved_files, script

FOLDER = Path(__file__).parents[1] / "servo" / "tutorials"
PRINTS = {
    "your_tracker": [
        (r"contract: (kept)", "kept"),
        (r"median flow holds the car within ([\d.]+) px, pf_ssd 0.35", (1.0, 4.0)),
    ],
    "your_robot_and_object": [(r"CONVERGED: within ([\d.]+) px rms", (0.0, 2.0))],
    "your_footage": [
        (r"(region: 131.0,105.5,57.9,29.0)", "region: 131.0,105.5,57.9,29.0"),
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
    "first_start_eye_to_hand": [
        (r"mistake +wrong +(the sign of x of)", "the sign of x of"),
        (r"clock offset +adjust +([\d.]+) ms", (77.0, 83.0)),
        (r"mount: rotation +ok +roll (-[\d.]+)", (-100.6, -99.4)),
        (r"mount: lever +ok +x -?[\d.]+, y (-[\d.]+)", (-910.0, -890.0)),
        (r"commands +(unknown) ", "unknown"),
    ],
    "first_start": [
        (r"mistake +wrong +(the quaternion's)", "the quaternion's"),
        (r"mistake +wrong +(lengths are in)", "lengths are in"),
        (r"clock offset +adjust +([\d.]+) ms", (77.0, 83.0)),
        (r"commands +ok +(followed)", "followed"),
        (
            r"(ready, but adjust: clock offset. Next: servobench tune twin/twin.toml)",
            "ready, but adjust: clock offset. Next: servobench tune twin/twin.toml",
        ),
        (r"median difference ([\d.]+) of 255", (0.0, 12.0)),
    ],
}
"""What each page prints: a number and its bounds, or words. The robot's clock does not wait for a
busy machine, so its numbers vary."""
FEWER = {
    "duration = 28.0\n": "duration = 14.0\n",
    "latency = 2\n\n[motion]": "latency = 2\n\n[camera]\nrate = 15\n\n[motion]",
    '[camera]\nmounted = "world"': '[camera]\nrate = 15\nmounted = "world"',
    "FRAMES, 300": "FRAMES, 100",
    "seeds = 5\n": "seeds = 2\n",
    "sweep lag.toml --out lag --quiet": "sweep lag.toml --out lag --quiet --workers 1",
}
"""What a page says, and what its test does: fewer runs and pictures print as much, without a worker's start."""
ELSEWHERE = {
    "a_law_that_switches": "test_switched_law.py",
    "imitate_a_law": "test_imitation.py",
    "drivers": "test_drivers.py",
    "exercises": "test_exercises.py",
    "learn_a_residual": "test_gym.py",
}
"""Pages of which another test runs the file that they say to save."""


def test_every_tutorial_is_tested():
    pages = {path.stem for path in FOLDER.glob("*.md")} - {"README"}
    assert pages == PRINTS.keys() | ELSEWHERE.keys()


@pytest.mark.parametrize("name", ELSEWHERE)
def test_the_other_test_reads_the_page(name):
    assert f"{name}.md" in (Path(__file__).parent / ELSEWHERE[name]).read_text()


def test_the_code_of_a_page_is_its_blocks_in_order():
    page = (
        "Save as `a.toml`:\n\n```toml\nx = 1\n```\n\n```python\nprint(1)\n```\n"
        "Then:\n\n```sh\necho 2\n```\n\n```python\nprint(3)\n```\n"
    )
    assert saved_files(page) == {"a.toml": "x = 1\n"}
    assert re.findall(r"\d", script(page)) == ["1", "2", "3"]


@pytest.mark.processes
@pytest.mark.parametrize("name", PRINTS)
def test_a_tutorial_prints_its_numbers(name, tmp_path):
    page = (FOLDER / f"{name}.md").read_text()
    for said, done in FEWER.items():
        page = page.replace(said, done)
    for file, content in {**saved_files(page), f"{name}.py": script(page)}.items():
        (tmp_path / file).write_text(content)
    path = os.pathsep.join([str(on_path(tmp_path / "bin")), os.environ["PATH"]])
    code, out, err = ran(
        [f"{name}.py"],
        program=SCRIPT,
        cwd=tmp_path,
        env=os.environ | {"PATH": path, "MPLBACKEND": "agg"},
    )
    assert code == 0, err
    for pattern, expected in PRINTS[name]:
        found = re.search(f"^.*{pattern}", out, re.MULTILINE)
        assert found, (pattern, out)
        if isinstance(expected, str):
            assert found[1] == expected
        else:
            low, high = expected
            assert low <= float(found[1]) <= high, found[0]
    assert min(cv2.imread(str(tmp_path / f"{name}.png")).shape[:2]) > 200
