"""What a scenario draws for each seed."""

import numpy as np
import pytest

from servo.mistake import Mistake
from servo.scenario.load import load, parse

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


def test_trackers_get_the_same_draws():
    one, other = (load("line", [f"tracker.kind={k}"], seed=5).drawn for k in ("kams", "pf_ssd"))
    assert one == other != {}


@pytest.mark.parametrize(
    ("change", "left"),
    [
        ("start.x=3.0", {"start.y", "start.angle_deg", "motion.y", "motion.heading_deg",
                         "motion.speed"}),
        ("motion.kind=sine", {"start.x", "start.y", "start.angle_deg"}),
        ("motion.kind=line", {"start.x", "start.y", "start.angle_deg", "motion.y",
                              "motion.heading_deg", "motion.speed"}),
        ("vary.start={ x = { uniform = [1, 1] } }", {"start.x", "motion.y", "motion.heading_deg",
                                                      "motion.speed"}),
    ],
)  # fmt: skip
def test_what_is_set_is_not_drawn(change, left):
    assert set(load("line", [change], seed=3).drawn) == left


@pytest.mark.parametrize(
    ("vary", "said"),
    [
        (3, "mine.toml: vary should be a table of settings and laws, not 3"),
        ({"start": {"x": 3.0}}, "mine.toml: vary.start.x = 3.0: expected a law, such as "
                                "{ uniform = [-5, 5] }"),
        ({"start": {"x": {"evenly": [1, 2]}}}, "mine.toml: vary.start.x.evenly = [1, 2]: expected "
                                               "a law, such as { uniform = [-5, 5] }"),
        ({"start": {"x": {"uniform": [1, 2], "choice": [3]}}},
         "mine.toml: vary.start.x = {'uniform': [1, 2], 'choice': [3]}: expected one law: uniform, "
         "log_uniform, normal, choice"),
        ({"start": {"scale": {"uniform": [0.0, 2.0]}}},
         "mine.toml: vary.start.scale: start.scale = 0.0: input should be greater than or equal "
         "to 0.01"),
        ({"start": {"z": {"uniform": [0.0, 2.0]}}},
         "mine.toml: vary.start.z: start: there is no key 'z'; there is x, y, angle_deg, scale, "
         "tilt_deg, tilt_towards_deg, pose"),
        ({"tracker": {"kind": {"choice": ["kams"]}}},
         "mine.toml: vary.tracker.kind: this is not drawn; draw a setting, such as start.x"),
        ({"run": {"seed": {"choice": [1]}}},
         "mine.toml: vary.run.seed: this is not drawn; draw a setting, such as start.x"),
    ],
)  # fmt: skip
def test_mistakes(vary, said):
    with pytest.raises(Mistake) as found:
        with_seed(1, vary=vary)
    assert str(found.value) == said
