"""The exercises for a course: each command of `exercises.md` gives the number of its answer."""

import itertools
import re
import shlex
from pathlib import Path

import pytest
from measured import measured_run

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
