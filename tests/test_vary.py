"""What a scenario draws for each seed."""

import numpy as np
import pytest

from servo.mistake import Mistake
from servo.papers.experiments import is_clear
from servo.scenario.catalogue import shipped
from servo.scenario.draws import draws_of
from servo.scenario.load import load, parse
from servo.scenario.named_files import read

TABLE = {
    "run": {"duration": 1.0},
    "motion": {"kind": "line", "speed": 0.1},
    "vary": {
        "start": {"x": {"uniform": [-8.0, 8.0]}},
        "motion": {"y": {"choice": [0.1, 0.2]}, "speed": {"normal": [0.1, 0.01]}},
    },
}


def with_seed(seed, **changes):
    return parse(TABLE | {"run": {"duration": 1.0, "seed": seed}} | changes, "mine", "mine.toml")


def test_seed_0_is_the_scenario_as_written():
    scenario = with_seed(0)
    assert (scenario.start.x, scenario.motion.speed, scenario.drawn) == (0.0, 0.1, {})


def test_every_other_seed_is_another_run_and_the_same_each_time():
    drawn = [with_seed(seed) for seed in range(1, 40)]
    xs = np.array([s.start.x for s in drawn])
    assert len(set(xs)) == len(xs)
    assert -8 <= xs.min() < -5
    assert 5 < xs.max() <= 8
    assert {s.motion.y for s in drawn} == {0.1, 0.2}
    assert with_seed(7).drawn == drawn[6].drawn
    assert drawn[6].drawn["start.x"] == drawn[6].start.x
    assert drawn[6].table["vary"] == TABLE["vary"]  # parsing it again draws the same


@pytest.mark.parametrize("name", shipped())
def test_two_seeds_of_a_shipped_scenario_are_two_runs(name):
    draws = draws_of(read(name)[0]["vary"], name)
    assert [d.value(1) for d in draws] != [d.value(2) for d in draws]


@pytest.mark.parametrize("name", shipped())
def test_no_draw_lets_the_target_drive_through_a_toy(name):
    """Seeds 0 to 20 of all were tried; a template with a toy in it is another target."""
    assert all(is_clear(load(name, [], seed)) for seed in (0, 1, 8, 20))


def test_a_number_inside_a_list_is_drawn_and_set():
    drawn = load("border_qp", seed=1)
    written = load("border_qp").start.pose
    assert {f"start.pose.{i}" for i in range(6)} < drawn.drawn.keys()
    assert drawn.start.pose == tuple(drawn.drawn[f"start.pose.{i}"] for i in range(6))
    assert np.abs(np.subtract(drawn.start.pose, written)).max() <= 0.5
    one = load("border_qp", ["start.pose.2=1.1"], seed=1)
    assert one.start.pose == (*drawn.start.pose[:2], 1.1, *drawn.start.pose[3:])
    assert load("border_qp", ["start.pose=[0, 0, 1, 0, 0, 0]"], seed=1).start.pose[0] == 0


def test_trackers_get_the_same_draws():
    one, other = (load("line", [f"tracker.kind={k}"], seed=5).drawn for k in ("kams", "pf_ssd"))
    assert one == other != {}


START = {"start.x", "start.y", "start.angle_deg", "start.scale"}
WAY = {"motion.x", "motion.y", "motion.heading_deg", "motion.speed"}


@pytest.mark.parametrize(
    ("change", "left"),
    [
        ("start.x=3.0", START - {"start.x"} | WAY),
        ("motion.kind=sine", START),
        ("motion.kind=line", START | WAY),
        ("vary.start={ x = { uniform = [1, 1] } }", {"start.x"} | WAY),
    ],
)
def test_what_is_set_is_not_drawn(change, left):
    assert set(load("line", [change], seed=3).drawn) == left


@pytest.mark.parametrize(
    ("vary", "said"),
    [
        (3, "mine.toml: vary should be a table of settings and distributions, not 3"),
        (
            {"start": {"x": 3.0}},
            "mine.toml: vary.start.x = 3.0: expected a distribution, such as { uniform = [-5, 5] }",
        ),
        (
            {"start": {"x": {"evenly": [1, 2]}}},
            "mine.toml: vary.start.x.evenly = [1, 2]: expected "
            "a distribution, such as { uniform = [-5, 5] }",
        ),
        (
            {"start": {"x": {"uniform": [1, 2], "choice": [3]}}},
            "mine.toml: vary.start.x = {'uniform': [1, 2], 'choice': [3]}: expected one distribution with its numbers, one of uniform, "
            "log_uniform, normal, choice",
        ),
        (
            {"start": {"scale": {"uniform": [0.0, 2.0]}}},
            "mine.toml: vary.start.scale: start.scale = 0.0: input should be greater than or equal "
            "to 0.01",
        ),
        (
            {"start": {"z": {"uniform": [0.0, 2.0]}}},
            "mine.toml: vary.start.z: start: there is no key 'z'; there is x, y, angle_deg, scale, "
            "tilt_deg, tilt_towards_deg, pose",
        ),
        (
            {"tracker": {"kind": {"choice": ["kams"]}}},
            "mine.toml: vary.tracker.kind: this setting cannot be drawn at random; draw another one, such as start.x",
        ),
        (
            {"run": {"seed": {"choice": [1]}}},
            "mine.toml: vary.run.seed: this setting cannot be drawn at random; draw another one, such as start.x",
        ),
    ],
)
def test_mistakes(vary, said):
    with pytest.raises(Mistake) as found:
        with_seed(1, vary=vary)
    assert str(found.value) == said


@pytest.mark.parametrize("change", [{"seed": 3}, {"overrides": ["run.seed=3"]}])
def test_a_draw_of_the_seed_is_refused_where_the_seed_is_given_too(tmp_path, change):
    path = tmp_path / "mine.toml"
    path.write_text("[vary]\nrun.seed = { choice = [5, 6] }\n")
    with pytest.raises(Mistake) as told:
        load(str(path), **change)
    assert str(told.value) == (
        "mine.toml: vary.run.seed: this setting cannot be drawn at random; draw another one, such as start.x"
    )
