"""The vector environment: it gives what its environments give alone, and what Gymnasium's own gives
that runs them one after the other.
"""

import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium")

import servo.gym  # noqa: E402
from servo import Mistake  # noqa: E402
from servo.gym_vector import ServoVectorEnv  # noqa: E402

COUNT = 3
SETTINGS = {"scenario": "line", "overrides": ["run.duration=0.2"], "tracker": "truth"}
ACTIONS = np.random.default_rng(1).uniform(-1, 1, (9, COUNT, 4)).astype(np.float32)
"""Each run has 6 pictures: the sixth action meets runs that are over."""


def many(mode="vector_entry_point", **settings):
    return gymnasium.make_vec(
        servo.gym.ID, num_envs=COUNT, vectorization_mode=mode, **SETTINGS | settings
    )


def same(one, other):
    """Fail unless two nested results have the same keys, types and numbers."""
    if isinstance(one, dict):
        assert one.keys() == other.keys()
        for key in one:
            same(one[key], other[key])
    else:
        assert np.asarray(one).dtype == np.asarray(other).dtype
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize(
    ("observation", "seed"), [("features", 5), ("both", [4, 9, 4]), ("features", None)]
)
def test_it_gives_what_gymnasiums_own_gives(observation, seed):
    ours = many(observation=observation)
    theirs = many("sync", observation=observation)
    if seed is None:  # each draws from a stream that an earlier seed began
        ours.reset(seed=1)
        theirs.reset(seed=1)
    assert ours.metadata["autoreset_mode"] == theirs.metadata["autoreset_mode"]
    assert ours.observation_space == theirs.observation_space
    assert ours.action_space == theirs.action_space
    for one, other in zip(ours.reset(seed=seed), theirs.reset(seed=seed), strict=True):
        same(one, other)
    for actions in ACTIONS:
        for one, other in zip(ours.step(actions), theirs.step(actions), strict=True):
            same(one, other)
    ours.close()
    theirs.close()


def test_each_environment_gives_what_it_gives_alone():
    envs = many()
    seen, infos = envs.reset(seed=7)
    for i in range(COUNT):
        alone = gymnasium.make(servo.gym.ID, **SETTINGS)
        first, info = alone.reset(seed=7 + i)
        same(seen[i], first)
        assert infos["seed"][i] == info["seed"] == 7 + i
    alone = gymnasium.make(servo.gym.ID, **SETTINGS)
    alone.reset(seed=9)
    for actions in ACTIONS[:5]:
        seen, rewards, terminated, truncated, infos = envs.step(actions)
        first, reward, *ends, info = alone.step(actions[2])
        same(seen[2], first)
        assert (rewards[2], [terminated[2], truncated[2]]) == (reward, ends)
        same(infos["T_object_camera"][2], info["T_object_camera"])
    assert truncated.all()
    envs.close()


def test_observations_stay_as_they_were_when_the_next_are_made():
    envs = many()
    first, _ = envs.reset(seed=0)
    kept = first.copy()
    envs.step(ACTIONS[0])
    np.testing.assert_array_equal(first, kept)
    envs.close()


def test_options_hold_for_one_run_and_render_gives_a_picture_of_each():
    envs = many(render_mode="rgb_array")
    envs.reset(seed=0, options={"overrides": ["run.duration=0.1"]})
    over = [envs.step(actions)[3].all() for actions in ACTIONS[:2]]
    assert over == [False, True]
    pictures = envs.render()
    assert len(pictures) == COUNT
    assert pictures[0].dtype == np.uint8
    envs.close()
    assert many().render() is None


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        (lambda: ServoVectorEnv(0), "num_envs = 0: expected a whole number from 1 on"),
        (
            lambda: many().reset(seed=[1]),
            "seed: expected one for each of the 3 environments, got 1",
        ),
        (lambda: many().step(ACTIONS[0]), "step: there is no run; call reset first"),
        (
            lambda: many().step(ACTIONS[0][:2]),
            "step: expected one for each of the 3 environments, got 2",
        ),
    ],
)
def test_a_mistake_is_a_sentence(wrong, sentence):
    with pytest.raises(Mistake) as found:
        wrong()
    assert str(found.value) == sentence


def test_there_is_no_window(monkeypatch):
    monkeypatch.setattr(servo.gym, "has_display", lambda: True)
    with pytest.raises(Mistake, match="n environments have no window; use 'rgb_array'"):
        many(render_mode="human")


def test_by_default_there_is_one_environment():
    envs = ServoVectorEnv(**SETTINGS)
    assert (envs.num_envs, len(envs.envs), envs.action_space.shape) == (1, 1, (1, 4))
