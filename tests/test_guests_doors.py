"""One tracker of another author by every way to connect it: the same estimates, bit for bit."""

import dataclasses
import re
import shlex
import sys
from pathlib import Path

import numpy as np
import pytest
from followed import frame

from servo.cli.main import app
from servo.cli.new_command import new
from servo.loop.episode import Episode
from servo.mistake import Mistake
from servo.scenario.load import load
from servo.scenario.part_names import changes_of, settings_of
from tracking import configured, wrap
from tracking.trackers.program import Config as Program
from tracking.trackers.trax import Config as Trax
from tracking.types import Region, State

TOOLS = Path(__file__).parent / "tools"
PYTHON = shlex.quote(sys.executable)
SERVED = "guests:Drifting"
BETWEEN, PLACE = Region(30.453, 20.637), State(55.31, 40.24)
"""A region between pixels: how it is rounded must not depend on the door."""


@pytest.fixture(autouse=True)
def found_by_programs(monkeypatch):
    monkeypatch.setenv("PYTHONPATH", str(TOOLS))


def by_class(kind=SERVED):
    return configured(kind)


def by_process(kind=SERVED):
    return Program(command=f"{PYTHON} -m tracking.exported.program_server {kind}")


def by_trax(kind=SERVED, region="rectangle"):
    return Trax(command=f"{PYTHON} -m guests trax {region} {kind}")


def by_our_trax(kind=SERVED):
    """A polygon is sent, and corners come back."""
    return Trax(command=f"{PYTHON} -m tracking.exported.trax_server {kind}")


def by_lines(kind=SERVED):
    return Program(command=f"{PYTHON} -m guests lines rectangle {kind}")


DOORS = {
    "a class in GOT-10k's convention": lambda: by_class("guests:DriftingFromOne"),
    "a class in a process of its own": by_process,
    "a program that speaks lines of JSON": by_lines,
    "TraX with rectangles": by_trax,
    "TraX with polygons": lambda: by_trax(region="polygon"),
    "our own server of TraX": by_our_trax,
}


def numbers(estimate):
    status = estimate.status.name
    return (*estimate.state.vector.tolist(), estimate.distance, status, estimate.follows)


def followed(config, count=12):
    tracker = config.build(np.random.default_rng(3))
    tracker.start(frame(0), BETWEEN, PLACE)
    found = [tracker.update(frame(k)) for k in range(1, count)]
    assert {e.corners is None for e in found} == {True}
    return [numbers(e) for e in found]


@pytest.mark.parametrize("door", DOORS)
def test_a_guest_gives_the_same_by_every_door(door):
    expected = followed(by_class())
    assert expected[0][0] != expected[-1][0]
    assert expected[-1][6] == (False, True)
    assert {e[5] for e in expected} == {"LOCKED", "UNSURE"}
    assert followed(DOORS[door]()) == expected


def test_opencvs_own_tracker_is_the_same_in_a_process_of_its_own():
    """Begun on a turned region: the box around it must be the same to the last digit."""
    turned = Region(30.453123457, 20.637987653), State(55.310000451, 40.240000813, 0.1)

    def seen(config):
        tracker = config.build(np.random.default_rng(3))
        tracker.start(frame(0), *turned)
        return [numbers(tracker.update(frame(k))) for k in range(1, 6)]

    assert seen(by_class("cv2:TrackerMIL")) == seen(by_process("cv2:TrackerMIL"))


def run(config, condition):
    scenario = load(condition, ["run.duration=0.5"])
    with Episode(dataclasses.replace(scenario, tracker=config)) as episode:
        return [numbers(step.estimate) for step in episode]


def test_it_closes_the_loop_with_the_same_numbers_by_two_doors():
    assert run(by_class(), "circle") == run(by_process(), "circle")


def test_a_guest_with_an_angle_is_the_same_in_a_process_of_its_own():
    kind = "guests:Turning"
    expected = followed(by_class(kind))
    assert expected[-1][2] != 0
    assert followed(by_process(kind)) == expected


def test_a_class_that_draws_gets_the_same_seed_in_any_process():
    kind = "guests:Drawing"
    expected = followed(by_class(kind))
    assert len({e[0] for e in expected}) > 1
    assert followed(by_process(kind)) == expected


@pytest.mark.parametrize(
    ("section", "what", "expected"),
    [
        ("tracker", "kams:paper", {"kind": "kams", "preset": "paper"}),
        ("tracker", "mine:Class", {"kind": "mine:Class"}),
        ("tracker", "trax", {"kind": "trax"}),
        ("tracker", "trax:python s.py", {"kind": "trax", "command": "python s.py"}),
        ("tracker", "program:python s.py", {"kind": "program", "command": "python s.py"}),
        ("tracker", "onnx:v.onnx", {"kind": "opencv", "name": "Vit", "model": "v.onnx"}),
        ("tracker", "onnx:a,b", {"kind": "opencv", "name": "Nano", "model": ["a", "b"]}),
        ("controller", "onnx:p.onnx", {"kind": "onnx", "file": "p.onnx"}),
        ("controller", "qp", {"kind": "qp"}),
    ],
)
def test_a_part_is_named_in_one_way_by_every_command(section, what, expected):
    found = {
        key.removeprefix(f"{section}."): value for key, value in settings_of(section, what).items()
    }
    assert found == expected
    assert len(changes_of(**{"tracker": None, "controller": None, section: what})) == len(expected)


def test_run_takes_a_tracker_and_a_controller(tmp_path, capsys):
    words = ["run", "still", "--tracker", "guests:Drifting", "--controller", "hold"]
    words += ["--set", "run.duration=0.3", "--no-rerun", "--out", str(tmp_path / "run"), "--quiet"]
    with pytest.raises(SystemExit):
        app(words)
    assert '"kind": "guests:Drifting"' in (tmp_path / "run" / "report.json").read_text()


def test_a_new_tracker_gives_the_same_by_each_door_it_can_be_begun_with(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for door in ("class", "program", "trax"):
        new("tracker", f"my_{door}", tmp_path / door, door)
    monkeypatch.syspath_prepend(tmp_path / "class")
    mine = configured("my_class.tracker:MyClass")
    expected = followed(mine)
    assert [e[0] for e in expected] == [55.5 + 2 * k for k in range(1, 12)]  # of whole pixels
    program = tmp_path / "program" / "my_program" / "program.py"
    assert followed(Program(command=f"{PYTHON} {program}")) == expected
    server = tmp_path / "trax" / "my_trax" / "server.py"
    assert followed(Trax(command=f"{PYTHON} {server}")) == expected
    commands = [
        (tmp_path / door / "README.md").read_text() for door in ("class", "program", "trax")
    ]
    assert [re.search(r"run line --tracker (.*)", text)[1] for text in commands] == [
        "my_class.tracker:MyClass",
        "'program:python my_program/program.py'",
        "'trax:python my_trax/server.py'",
    ]


def test_a_door_is_for_trackers(tmp_path):
    with pytest.raises(Mistake) as refused:
        new("law", "mine", tmp_path / "law", "trax")
    assert str(refused.value) == (
        "--door trax has no effect on law: leave it out, or write `servobench new tracker`"
    )


class Oracle:
    """Returns the true box: the target's centre and size, as the simulation knows them."""

    gives = ("size",)

    def init(self, image, box):  # GOT-10k's convention: pixels counted from 1, no whole numbers
        self.given = np.array(box[2:], float)

    def knows(self, episode):
        self.episode, self.first = episode, episode._truths[0]
        self.sides = self.given

    def update(self, _image):
        self.now = self.episode._truths[max(self.episode._truths)]
        sides = self.sides * self.now.size / self.first.size
        return np.array([*(self.now.centre + 1 - sides / 2), *sides])


class Turning(Oracle):
    """Returns the true angle too, with the box of the region that is not turned."""

    gives = ("size", "angle")

    def knows(self, episode):
        super().knows(episode)
        c, s = abs(np.cos(self.first.theta)), abs(np.sin(self.first.theta))
        self.sides = np.linalg.solve([[c, s], [s, c]], self.given)

    def update(self, image):
        return {"box": super().update(image), "angle": self.now.theta}


UPRIGHT = "line barrel approach circle tilt_40_plate fisheye lighting spin mesh_circle hand_plate"
TURNED = "circle spin six_motion turn_90_points turn_150_points border_pose latency_3"


@pytest.mark.parametrize(
    ("oracle", "scenario"),
    [(Oracle, each) for each in UPRIGHT.split()] + [(Turning, each) for each in TURNED.split()],
)
def test_a_guest_that_returns_the_true_box_is_as_good_as_the_truth(oracle, scenario):
    guest = oracle()
    settings = load(scenario, ["run.duration=0.4"])
    config = wrap(lambda: guest)()
    with Episode(dataclasses.replace(settings, tracker=config)) as episode:
        guest.knows(episode)
        steps = [step.light() for step in episode]
    for step in steps[1:]:
        true = step.true_state_estimated
        found = step.estimate.state
        assert np.hypot(found.x - true.x, found.y - true.y) < 1e-4
        assert abs(found.scale / true.scale - 1) < 1e-6
        if oracle is Turning:
            assert abs(found.theta - true.theta) < 1e-6
    assert steps[-1].estimate.follows == (oracle is Turning, True)
