"""A policy in a process of its own, which speaks lines of JSON."""

import shlex
import sys

import numpy as np
import pytest

import servo
from servo import Mistake
from servo.bench.benchmark import Band, load
from servo.bench.contestant import Contestant, Division, contestants
from servo.bench.world_run import jobs_of
from servo.bench.world_score import world_score
from servo.controllers._plain_law import since
from servo.controllers.program import PolicyProgram
from servo.scenario.part_names import changes_of, settings_of

SHORT = ["run.duration=0.4", "run.latency=0", "estimator.kind=none", "camera.width=64"]
SHORT += ["camera.height=48", "camera.renderer=exact", "tracker.kind=truth"]
LENS = ["camera.distortion=plumb_bob", "camera.coefficients=[0.01, 0, 0, 0, 0]"]
MODULE = """
import numpy as np

class Blend:
    def __init__(self, gain=0.01):
        self.gain = gain
        self.first = None

    def reset(self):
        self.first = None

    def act(self, picture, goal_picture, camera, posture, depth):
        if self.first is None:
            self.first = picture.mean()
        lens = camera.distortion
        bent = 0.0 if lens is None else lens.coefficients[0]
        pose = posture.T_base_camera
        apart = picture.mean(axis=(0, 1)) - goal_picture.mean(axis=(0, 1))
        head = self.gain * apart + posture.joints[:3] + pose.translation
        tail = [camera.fx * 1e-4 + bent, depth * 1e-2, posture.jacobian[0, 0] * 1e-3]
        return np.concatenate([head, tail]) + pose.rotation[0, 1]

def placed(picture, goal_picture, posture):
    return [0.0] * 6


def plain(seen, task):
    return np.zeros(6)
"""
BY_HAND = """
import json, sys
import numpy as np

goal = None
for line in iter(sys.stdin.buffer.readline, b""):
    asked = json.loads(line)
    if "seed" in asked:
        assert isinstance(asked["seed"], int)
        answer = {}
    else:
        shape = asked["height"], asked["width"], 3
        picture = np.frombuffer(sys.stdin.buffer.read(int(np.prod(shape))), np.uint8).reshape(shape)
        mean = picture.mean(axis=(0, 1))
        if "goal" in asked:
            goal, camera, depth = mean, asked["goal"]["camera"], asked["goal"]["depth"]
            bent = camera.get("distortion", {"coefficients": [0.0]})["coefficients"][0]
            answer = {}
        else:
            posture = {name: np.array(value, float) for name, value in asked["posture"].items()}
            head = 0.01 * (mean - goal) + posture["joints"][:3] + posture["translation"]
            tail = [camera["fx"] * 1e-4 + bent, depth * 1e-2, posture["jacobian"][0, 0] * 1e-3]
            twist = np.concatenate([head, tail]) + posture["rotation"][0, 1]
            answer = {"twist": twist.tolist()}
    print("a line of its own")
    print(json.dumps(answer), flush=True)
"""


@pytest.fixture
def module(tmp_path, monkeypatch):
    (tmp_path / "blend_policy.py").write_text(MODULE)
    (tmp_path / "by_hand.py").write_text(BY_HAND)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=":")


def twists(controller, *changes):
    scenario = servo.load("line", [*SHORT, *changes_of(None, controller), *changes])
    return np.array([step.command.twist for step in servo.run(scenario)])


def python(words):
    return f"program:{shlex.quote(sys.executable)} {words}"


@pytest.mark.wide
@pytest.mark.parametrize("lens", [[], LENS])
def test_a_class_has_the_same_commands_in_this_process_in_another_and_by_lines_of_json(
    module, lens
):
    own = twists("blend_policy:Blend", *lens)
    assert np.ptp(own, axis=0).min() > 0
    assert np.abs(own).max() < 10
    served = python("-m servo.policy_server blend_policy:Blend")
    np.testing.assert_array_equal(twists(served, *lens), own)
    np.testing.assert_array_equal(twists(python("by_hand.py"), *lens), own)


def test_a_setting_of_the_policy_is_given_on_the_servers_command_line(module):
    served = python("-m servo.policy_server blend_policy:Blend gain=0.02")
    assert not np.array_equal(twists(served), twists("blend_policy:Blend"))


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ("-c 'print(1)'", "failed: it ended with code 0 instead of sending a line of JSON"),
        ("-m servo.policy_server blend_policy:plain", "'blend_policy:plain' is no policy: give a"),
        (
            "-m servo.policy_server blend_policy:placed",
            "'blend_policy:placed' needs the robot's posture in the room, which a program does not "
            "get: give a function act(picture, goal_picture, camera, posture), perhaps with a last",
        ),
        (
            "-m servo.policy_server blend_policy:Other",
            "module 'blend_policy' has no attribute 'Other'",
        ),
    ],
)
def test_a_program_that_is_no_policy_is_refused(module, words, sentence):
    with pytest.raises(ValueError, match="failed: it ended") as found:
        PolicyProgram(python(words).removeprefix("program:"), 0, 5.0, 20.0)
    assert sentence in str(found.value)


@pytest.mark.parametrize("twist", ["[1, 2]", '"no"', "null", "[[1, 2, 3, 4, 5, 6]]"])
def test_an_answer_without_six_numbers_ends_the_run(module, tmp_path, twist):
    (tmp_path / "odd.py").write_text(BY_HAND.replace("twist.tolist()", f"json.loads('{twist}')"))
    with pytest.raises(Exception, match=r"answered the twist .* which is no list of 6 numbers"):
        twists(python("odd.py"))


def test_an_empty_command_is_refused():
    with pytest.raises(Mistake, match=r"^'program: ': write the command after it$"):
        twists("program: ")


def test_a_file_names_no_program(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text(
        '# servobench run mine\n# Mine.\n[controller]\nkind = "program"\ncommand = "x"\n'
    )
    with pytest.raises(Mistake, match="command"):
        servo.load(file)


def test_a_policy_takes_part_in_a_process_of_its_own(module):
    benchmark = load("goal-v1")
    one, other = contestants(benchmark, ["a=blend_policy:Blend", f"b={python('by_hand.py')}"])
    assert {one.division, other.division} == {Division.CLOSED}
    words = shlex.split(str(one.settings["controller.command"]))
    assert words[1:] == ["-m", "servo.policy_server", "blend_policy:Blend"]
    assert one.digest != other.digest
    (changed,) = contestants(benchmark, ["a=blend_policy:Blend"], ["controller.gain=0.02"])
    assert changed.division is Division.OPEN


class Blind:
    """What a policy that does not look can do: it drives to where the goal is on average, by the
    depth at the goal and its posture since the first picture."""

    def start(self, task):
        self.there = np.array([0.0, 0.0, -0.25 / task.goal.plane.C])
        self.first = None

    def command(self, seen, posture, dt):
        self.first = self.first or posture
        there = since(self.first, posture).T_base_camera.inverse().apply(self.there)
        return servo.Command(np.concatenate([there, np.zeros(3)]))


@pytest.mark.wide
def test_a_policy_that_does_not_look_has_fewer_than_5_points(tmp_path):
    benchmark = load("goal-v1")
    law = {
        "tracker.corners": True,
        "features.kind": "points",
        **settings_of("controller", f"{__name__}:Blind"),
    }
    blind = Contestant("blind", law, Division.OPEN)
    jobs = jobs_of(benchmark, [blind], benchmark.every_world(Band(), 1))
    scores = [world_score(benchmark.score, job.subject.perform(job, tmp_path)) for job in jobs]
    assert len(scores) == len(benchmark.conditions)
    assert 100 * np.mean([score.area for score in scores]) < 5
