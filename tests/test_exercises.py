"""The exercises for a course: each command of `exercises.md` gives the number of its answer."""

import itertools
import os
import re
import shlex
import subprocess
import sysconfig
from pathlib import Path

import pytest
from measured import measured_run
from tutorial_pages import saved_files

from servo.scenario.load import load

PAGE = (Path(__file__).parents[1] / "servo" / "tutorials" / "exercises.md").read_text()
COMMANDS = {
    words[-1]: words
    for words in map(shlex.split, re.findall(r"^servobench run .*$", PAGE, re.MULTILINE))
}
ANSWERS = re.findall(r"^\| (\w+) \| (\w+) \| ([\d.]+) \|$", PAGE, re.MULTILINE)


def test_every_command_has_an_answer():
    assert [run for run, _, _ in ANSWERS] == list(COMMANDS)


@pytest.mark.processes
@pytest.mark.parametrize(("run", "measure", "value"), ANSWERS)
def test_an_answer_is_what_the_command_measures(run, measure, value):
    words = COMMANDS[run]
    changes = [after for word, after in itertools.pairwise(words) if word == "--set"]
    _, summary = measured_run(load(words[2], changes))
    assert summary.measures[measure] == pytest.approx(float(value), rel=0.01, abs=1e-6)


@pytest.mark.processes
def test_the_marking_tells_a_law_that_moves_from_one_that_does_not(tmp_path):
    files = saved_files(PAGE)
    moves = re.sub(r"return .*one answer is (.*)", r"return \1", files["law.py"])
    (tmp_path / "task.toml").write_text(files["task.toml"])
    for student, law in (("ana", moves), ("bob", files["law.py"])):
        (tmp_path / student).mkdir()
        (tmp_path / student / "law.py").write_text(law)
    (loop,) = re.findall(r"```bash\n(.*?)```", PAGE, re.DOTALL)
    path = os.pathsep.join([sysconfig.get_path("scripts"), os.environ["PATH"]])
    env = os.environ | {"PATH": path}
    words = ["bash", "-c", loop]
    done = subprocess.run(words, cwd=tmp_path, env=env, stdout=subprocess.PIPE, text=True)
    assert done.stdout.splitlines() == [
        "ana/ passed",
        "bob/ failed",
        "missed: outcome is TIMED_OUT, expected CONVERGED",
        "missed: settle_s is not finite, expected at most 2",
        "missed: servo_rms_px is 60, expected at most 1",
    ]
