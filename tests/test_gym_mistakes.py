"""Wrong choices and options of the environment of Gymnasium; and which library it loads first."""

import pickle

import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium")

import servo  # noqa: E402
import servo.gym  # noqa: E402
from servo import Mistake  # noqa: E402
from servo.output.local_page import DISPLAYS  # noqa: E402

SHORT = ["run.duration=0.4", "tracker.particles=20"]


def made(**settings):
    return gymnasium.make(servo.gym.ID, **({"overrides": SHORT} | settings))


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        ({"reach": 0.2}, "reach: expected 2 finite numbers, got 0.2"),
        ({"reach": (-1, 1)}, "reach: expected speeds of at least 0, got (-1, 1)"),
        (
            {"dof": ["vx", "vx"]},
            "dof = ['vx', 'vx']: expected a list of some of vx, vy, vz, wx, wy, wz, each once",
        ),
        (
            {"scenario": "line", "seed": 3},
            "line: a seed cannot be set here: give it as reset(seed=...)",
        ),
        ({"goal_picture": "yes"}, "there is no goal_picture 'yes'; there is False, True"),
        ({"scenario": None}, "a scenario is given by its name or path, not by NoneType"),
        ({"overrides": None}, "None: expected a list of changes, such as ['run.duration=5']"),
    ],
)
def test_a_wrong_choice_is_a_sentence(wrong, sentence):
    with pytest.raises(Mistake) as found:
        made(**wrong)
    assert str(found.value) == sentence


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"seed": 3}, "options: a seed cannot be set here: give it as reset(seed=...)"),
        ({"run.seed": 3}, "options: a seed cannot be set here: give it as reset(seed=...)"),
        (
            {"features": "points"},
            "options: these settings change the shape of the observations; make a new environment with them (the old run was ended)",
        ),
    ],
)
def test_a_wrong_option_is_a_sentence(options, sentence):
    env = made()
    with pytest.raises(Mistake) as found:
        env.reset(seed=1, options=options)
    assert str(found.value) == sentence


def test_a_refused_reset_leaves_the_run_and_actions_outside_count_as_the_nearest():
    one, other = made().unwrapped, made().unwrapped
    for env in (one, other):
        env.reset(seed=1)
    with pytest.raises(Mistake, match="there is no setting 'gian'"):
        one.reset(options={"gian": 1.0})
    five = np.full(one.action_space.shape, 5.0, np.float32)
    first, *_ = one.step(five)
    second, *_ = other.step(five / 5.0)
    np.testing.assert_array_equal(first, second)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (
            {"observation": "image"},
            "there is no observation 'image'; there is features, picture, both",
        ),
        ({"action": "twists"}, "there is no action 'twists'; did you mean 'twist'?"),
        ({"dof": ["vz", "vw"]}, "there is no dof 'vw'; there is vx, vy, vz, wx, wy, wz"),
        ({"gian": 1.0}, "there is no setting 'gian'; did you mean 'gain'?"),
        (
            {"render_mode": "human"},
            "render_mode='human': there is no display here; use 'rgb_array'",
        ),
    ],
)
def test_mistakes_are_one_sentence(given, message, monkeypatch):
    for name in DISPLAYS:
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(Mistake) as found:
        servo.gym.ServoEnv(**given)
    assert str(found.value) == message


def test_a_mistake_can_be_made_of_one_as_a_vector_environment_does():
    assert str(Mistake(Mistake("this is wrong"))) == "this is wrong"


def test_an_environment_can_be_pickled_before_its_first_run():
    env = made().unwrapped
    assert pickle.loads(pickle.dumps(env)).frames == env.frames


def test_a_start_that_cannot_be_reached_leaves_the_run_as_it_was():
    env = made(scenario="arm_line", overrides=SHORT).unwrapped
    env.reset(seed=0)
    with pytest.raises(Mistake, match="cannot bring the camera to its start pose"):
        env.reset(seed=0, options={"start": {"x": 300, "y": 200}, "goal": {"depth": 1.5}})
    env.step(np.zeros(env.action_space.shape))


def test_a_drawn_start_that_cannot_be_is_drawn_again(monkeypatch):
    start = servo.Episode._start

    def on_the_left(episode, world, config, way):
        if config.x > 0:
            raise ValueError("it is on the right")
        return start(episode, world, config, way)

    monkeypatch.setattr(servo.Episode, "_start", on_the_left)  # a search for a start takes seconds
    settings = {"overrides": ["run.duration=0.4", "tracker.kind=truth"]}
    settings["vary"] = {"start.x": {"uniform": [-10, 10]}}
    resets = [7, None, 1]
    told = []
    for _ in range(2):
        env = made(**settings)
        told.append([env.reset(seed=seed)[1] for seed in resets])
    seeds, redrawn, draws = ([info[k] for info in told[0]] for k in ("seed", "redrawn", "drawn"))
    assert redrawn == [2, 0, 0]
    assert seeds == [info["seed"] for info in told[1]]
    assert all(drawn["start.x"] < 0 for drawn in draws)
    refusal = "reversal: start, seed 7: it is on the right"
    with pytest.raises(Mistake) as refused:
        made(redraw=0, **settings).reset(seed=7)
    assert str(refused.value) == (
        f"{refusal} (redraw = 0: 0 other seeds were tried too, and none has a possible start; a larger redraw tries more)"
    )
    as_written = {"overrides": [*settings["overrides"], "start.x=5", "expect={}"], "vary": {}}
    with pytest.raises(Mistake) as refused:
        made(**as_written).reset(seed=7)  # no other seed could help
    assert str(refused.value) == refusal
