"""Trackers as programs that speak lines of JSON: the page's examples, and programs that fail."""

import dataclasses
import re
import shlex
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import psutil
import pytest
from followed import REGION, START, frame

from tracking.trackers.program import Config
from tracking.types import Status

PAGE = (Path(__file__).parents[1] / "tracking" / "PROGRAMS.md").read_text()
PYTHON = shlex.quote(sys.executable)
BEGIN = """
import json, os, sys, time
asked = json.loads(sys.stdin.buffer.readline())
count = -1
def say(answer):
    sys.stdout.write((answer if isinstance(answer, str) else json.dumps(answer)) + "\\n")
    sys.stdout.flush()
def each():
    global count
    while line := sys.stdin.buffer.readline():
        asked = json.loads(line)
        count += 1
        yield asked, sys.stdin.buffer.read(asked["height"] * asked["width"] * 3)
"""


def example(language):
    return re.search(rf"```{language}\n(.*?)```", PAGE, re.DOTALL)[1]


def followed(config, count=6):
    tracker = config.build(np.random.default_rng(0))
    tracker.start(frame(0), REGION, START)
    return [tracker.update(frame(k)) for k in range(1, count)]


def program(tmp_path, body, **settings):
    path = tmp_path / "theirs.py"
    path.write_text(BEGIN + body)
    return Config(command=f"{PYTHON} {path}", **settings)


def test_the_pages_example_in_python_runs(tmp_path):
    (tmp_path / "my_tracker.py").write_text(example("py"))
    found = followed(Config(command=f"{PYTHON} {tmp_path / 'my_tracker.py'}"))
    assert {(e.state, e.status, e.follows) for e in found} == {
        (START, Status.LOCKED, (False, False))
    }


def test_the_pages_example_in_javascript_runs(tmp_path):
    if not shutil.which("node"):
        pytest.skip("Node is not on this machine")
    (tmp_path / "my_tracker.js").write_text(example("javascript"))
    assert len(example("javascript").splitlines()) <= 40
    found = followed(Config(command=f"node {tmp_path / 'my_tracker.js'}"))
    x, y = (int(v) for v in (found[0].state.x, found[0].state.y))
    assert (found[0].state.x, found[0].state.y) == (x + 0.5, y + 0.5)
    green = frame(1).image[30:50, 40:70, 1]
    assert frame(1).image[y, x, 1] == green.max()


@pytest.mark.skipif(not shutil.which("g++"), reason="g++ is not on this machine")
def test_the_pages_example_in_cpp_runs(tmp_path):
    (tmp_path / "my_tracker.cpp").write_text(example("cpp"))
    words = ["g++", "-Wall", "-Wextra", "-Werror", "-o", "my_tracker", "my_tracker.cpp"]
    subprocess.run(words, cwd=tmp_path, check=True)
    found = followed(Config(command=str(tmp_path / "my_tracker")))
    assert {(e.state, e.status, e.follows) for e in found} == {
        (START, Status.LOCKED, (False, False))
    }


def test_it_is_told_the_seed_the_time_and_the_target(tmp_path):
    body = f"""
open({str(tmp_path / "told")!r}, "w").write(json.dumps(asked))
say({{"gives": ["size"]}})
for asked, picture in each():
    open({str(tmp_path / "told")!r}, "a").write("\\n" + json.dumps(asked) + str(sum(picture)))
    say({{"box": [40, 30, 30, 20 + count]}})
"""
    (found,) = followed(program(tmp_path, body), 2)
    assert found.follows == (False, True)
    seed = int(np.random.default_rng(0).integers(1 << 31))
    first = frame(0).image.sum(dtype=int)
    second = frame(1).image.sum(dtype=int)
    box = "[40.0, 30.0, 30.0, 20.0]"
    corners = "[[40.0, 30.0], [70.0, 30.0], [70.0, 50.0], [40.0, 50.0]]"
    assert (tmp_path / "told").read_text().splitlines() == [
        f'{{"seed": {seed}}}',
        f'{{"width": 160, "height": 100, "index": 0, "time": 0.0, "box": {box}, "angle": 0.0, '
        f'"corners": {corners}}}{first}',
        f'{{"width": 160, "height": 100, "index": 1, "time": 0.1}}{second}',
    ]


@pytest.fixture
def killed_at_once(monkeypatch):
    """A program that does not hear that it should end is not given half a second for it."""
    monkeypatch.setattr("tracking.guests.process.GRACE", 0.0)


SHORT = 0.4
"""Time limit of a program that is known to give no answer [s]."""
LIES = {
    "sys.exit('no weights')": "ended with code 1 instead of sending a line of JSON: no weights",
    "os.kill(os.getpid(), 9)": "was killed by SIGKILL instead of sending a line of JSON",
    "say('{nothing}')": "answered {nothing}, which is no JSON: Expecting property name enclosed in "
    "double quotes: line 1 column 2 (char 1)",
    "say('{\"a\":' * 200_000)": "which is no JSON: too deep",
    "say({'gives': 3})": "declares that it gives 3; it may give size, angle, corners",
    "say({'gives': ['depth']})": "declares that it gives 'depth'; it may give size, angle, corners",
    "say({'error': 'out\\nof memory'})": "refused: out of memory",
    "time.sleep(60)": "did not send a line of JSON within 0.4 s",
    "while True: say('noise')": "did not send a line of JSON within 0.4 s",
    "while True: sys.stdout.buffer.write(b'\\xff' * (1 << 16))": "did not send a line of JSON within 0.4 s",
    "while True: sys.stdout.buffer.write(b'{' + os.urandom(1 << 16))": "which is no JSON: ",
    "sys.stdout.write('x' * (1 << 25))": "ended with code 0 instead of sending a line of JSON",
    "os.close(1); time.sleep(60)": "closed its output instead of sending a line of JSON",
}


@pytest.mark.parametrize("lie", LIES)
def test_a_program_that_does_not_begin_is_a_sentence(tmp_path, request, lie):
    if "sleep" in lie or "while" in lie:
        request.getfixturevalue("killed_at_once")
    limit = SHORT if "within" in LIES[lie] else 10.0
    config = program(tmp_path, lie + "\n", loading=limit, timeout=limit)
    with pytest.raises(ValueError) as refused:
        followed(config)
    said = str(refused.value)
    assert said.startswith(f"program '{config.command}' ")
    assert LIES[lie] in said
    assert "\n" not in said


ANSWERS = {
    "say({'box': [1, 2, -3, 4]})": "'box' is [1, 2, -3, 4]; it must be left, top, width, height",
    "say('{\"box\": [NaN, 2, 3, 4]}')": "'box' is [nan, 2, 3, 4]; it must be left, top, width",
    "say({'box': 'here'})": "'box' is 'here'; it must be left, top, width, height",
    "say({'seen': 'yes', 'box': [1, 2, 3, 4]})": "'seen' is 'yes'; it must be true or false",
    "say({'box': [1, 2, 3, 4], 'confidence': 7})": "the confidence is 7; it must be from 0 to 1",
    "say({'where': 1})": "answered with the key 'where'; the keys are box, angle, corners, seen",
    "say({'error': 'lost'})": "refused: lost",
    "sys.exit(3)": "ended with code 3 instead of sending a line of JSON",
    "time.sleep(60)": "did not send a line of JSON within 0.4 s",
    "os.system('kill -STOP ' + str(os.getpid()))": "did not send a line of JSON within 0.4 s",
}


@pytest.mark.parametrize("lie", ANSWERS)
def test_a_program_that_fails_later_is_a_sentence(tmp_path, request, lie):
    body = (
        "say({})\nfor asked, picture in each():\n    if count < 3: say({'box': [40, 30, 30, 20]})\n"
    )
    limit = 10.0
    if "within" in ANSWERS[lie]:
        limit = SHORT
        request.getfixturevalue("killed_at_once")
    config = program(tmp_path, body + f"    else: {lie}\n", timeout=limit)
    before = set(psutil.Process().children(recursive=True))
    with pytest.raises(ValueError) as refused:
        followed(config)
    said = str(refused.value)
    assert said.startswith(f"program '{config.command}'")
    assert ANSWERS[lie] in said
    assert "\n" not in said
    psutil.wait_procs(set(psutil.Process().children(recursive=True)) - before, timeout=5)
    assert set(psutil.Process().children(recursive=True)) <= before


def test_a_second_answer_to_a_picture_is_noticed(tmp_path):
    body = """say({})
for asked, picture in each():
    say({"box": [40 + count, 30, 30, 20]})
    say({"box": [40, 30, 30, 20]})
    open(os.environ["TOLD"], "w").write(str(count))
"""
    told = tmp_path / "told"
    config = program(tmp_path, body)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("TOLD", str(told))
        tracker = config.build(np.random.default_rng(0))
        tracker.start(frame(0), REGION, START)
    until = time.monotonic() + 20
    while not told.exists() and time.monotonic() < until:
        time.sleep(0.01)
    with pytest.raises(
        ValueError,
        match=r"sent an answer that it was not asked for: it must answer each message once$",
    ):
        tracker.update(frame(1))


@pytest.mark.parametrize("pipes", ["None, None, None", "None, 1, 2"])
def test_a_child_in_a_session_of_its_own_holds_nothing_up(tmp_path, pipes):
    """It keeps the program's output open, and may stay: nothing can find it."""
    body = f"""
import subprocess
stdin, out, err = {pipes}
subprocess.Popen(["sleep", "20"], start_new_session=True, stdin=stdin, stdout=out, stderr=err)
say({{}})
for asked, picture in each():
    say({{"box": [40, 30, 30, 20]}})
    if count == 2: os._exit(4)
"""
    began = time.monotonic()
    with pytest.raises(ValueError, match=r"ended with code 4 instead of sending a line of JSON$"):
        followed(program(tmp_path, body))
    assert time.monotonic() - began < 15  # not the 20 s of the child, nor the limit of 30 s


@pytest.mark.usefixtures("killed_at_once")
def test_a_program_that_does_not_read_is_ended_in_time(tmp_path):
    """The pipe is full before the first picture of this size is sent."""
    config = program(tmp_path, "say({})\ntime.sleep(60)\n", timeout=SHORT)
    tracker = config.build(np.random.default_rng(0))
    large = dataclasses.replace(frame(0), image=np.zeros((1500, 2000, 3), np.uint8))
    began = time.monotonic()
    with pytest.raises(ValueError, match=r"did not send a line of JSON within 0\.4 s$"):
        tracker.start(large, REGION, START)
    assert time.monotonic() - began < 30


def test_a_program_that_was_ended_is_not_asked_again(tmp_path):
    body = "say({})\nfor asked, picture in each():\n    say({'box': 'here' if count else 0})\n"
    config = program(tmp_path, body)
    tracker = config.build(np.random.default_rng(0))
    tracker.start(frame(0), REGION, START)
    with pytest.raises(ValueError, match="'box' is 'here'"):
        tracker.update(frame(1))
    with pytest.raises(ValueError) as refused:
        tracker.update(frame(2))
    assert str(refused.value) == (
        f"program '{config.command}' was ended after an error, so it cannot follow any more "
        "pictures: start a new tracker"
    )


def test_a_command_must_be_there():
    for command, message in {
        " ": "the command of the program is empty: give it with --set or from Python (not in a TOML file), such as command = 'python my_program.py'",
        "no-such x": "program 'no-such x' cannot be started: No such file or directory",
    }.items():
        with pytest.raises(ValueError) as refused:
            followed(Config(command=command))
        assert str(refused.value) == message
