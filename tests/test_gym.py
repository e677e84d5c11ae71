"""The environment of Gymnasium: its contract, its seeds, its actions, its reward and its ends."""

import subprocess
import sys
import time
import warnings
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import numpy as np
import pytest
from tutorial_pages import saved_files

gymnasium = pytest.importorskip("gymnasium")

from gymnasium.utils.env_checker import check_env  # noqa: E402

import servo  # noqa: E402
import servo.gym  # noqa: E402
from servo import Mistake  # noqa: E402
from servo.scenario.catalogue import shipped  # noqa: E402

SHORT = ["run.duration=0.4", "tracker.particles=20"]
PAGE = Path(__file__).parents[1] / "servo" / "tutorials" / "learn_a_residual.md"


def made(**settings):
    return gymnasium.make(servo.gym.ID, **({"overrides": SHORT} | settings))


def steps_of(env, actions, **reset):
    """What an environment gives for some actions."""
    first, told = env.reset(**reset)
    return [(first, None, told), *((o, r, i) for o, r, _, _, i in map(env.step, actions))]


@pytest.mark.wide
@pytest.mark.parametrize("observation", servo.gym.OBSERVATIONS)
@pytest.mark.parametrize("action", servo.gym.ACTIONS)
def test_gymnasiums_own_check_finds_nothing(observation, action):
    env = made(observation=observation, action=action)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env.unwrapped)
    env.close()


def test_an_action_has_the_parts_that_the_law_moves():
    assert made(scenario="turn_90_points", overrides=()).action_space.shape == (6,)
    assert made(controller={"dof": ["vx", "wz"]}).action_space.shape == (2,)


def test_overrides_of_one_run_follow_those_of_the_environment():
    env = made(overrides=[*SHORT, "run.duration=0.4"]).unwrapped
    env.reset(seed=1, options={"overrides": ["run.duration=0.1"]})
    assert [env.step(np.zeros(4))[3] for _ in range(2)] == [False, True]


def test_both_ways_to_render_pass_gymnasiums_check(monkeypatch):
    monkeypatch.setattr(servo.gym, "has_display", lambda: True)
    monkeypatch.delenv("DISPLAY", raising=False)  # matplotlib then opens no window
    env = made(render_mode="rgb_array")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env.unwrapped)
    env.reset(seed=0)
    assert env.render().shape == (480, 640, 3)
    assert env.unwrapped.metadata["render_fps"] == 30


@pytest.mark.parametrize(
    "changes",
    [
        [],
        ["run.latency=2", "controller.acceleration=1.0"],
        ["run.latency=3", "estimator.kind=error_kalman"],
    ],
)
def test_no_residual_is_the_run_of_the_command(changes):
    """Also of a law that remembers its commands; the seed is the scenario's, with its draws."""
    env = made(overrides=[*SHORT, *changes])
    given = steps_of(env, np.zeros((11, 4), np.float32), seed=5)
    steps = list(servo.run(servo.load("reversal", [*SHORT, *changes], seed=5)))
    assert len(steps) == 12
    assert given[0][2]["drawn"] == servo.load("reversal", seed=5).drawn
    expected = [s.servo_error for s in steps]
    assert [told["servo_error_px"] for _, _, told in given] == expected
    assert all(
        (t["twist"] == s.command.twist).all() for (_, _, t), s in zip(given, steps, strict=True)
    )
    errors = np.array([seen[:4] for seen, _, _ in given])
    scales = steps[0].command.trace.scales
    assert errors == pytest.approx(np.array([s.error / scales for s in steps]), abs=1e-6)


@pytest.mark.parametrize("controller", ["hold", "broyden"])
def test_errors_are_observed_also_where_the_law_has_none_of_its_own(controller):
    changes = ["tracker.kind=truth", "features.kind=points", "run.duration=0.2"]
    known, other = (
        made(overrides=[*changes, f"controller.kind={k}"]) for k in ("ibvs", controller)
    )
    expected, _ = known.reset(seed=4)
    observed, _ = other.reset(seed=4)
    assert np.abs(expected[:8]).max() > 0.01
    assert observed[:8] == pytest.approx(expected[:8], abs=1e-6)


def test_frames_and_rate_are_those_of_the_run():
    env = made().unwrapped
    assert env.frames == 12
    env.reset(options={"duration": 2.0, "camera": {"rate": 10}})
    assert (env.frames, env.metadata["render_fps"]) == (20, 10)


def test_a_scenario_that_expects_drawn_settings_may_draw_none():
    _, told = made(scenario="line", vary={}).reset(seed=1)
    assert told["drawn"] == {}


def test_the_pose_is_told_and_its_goal():
    _, told = made(scenario="still", vary={}).reset(seed=0)
    assert told["T_object_goal"][:3, 3] == pytest.approx([0, 0, -1], abs=1e-9)
    away = np.linalg.norm(told["T_object_camera"][:3, 3] - told["T_object_goal"][:3, 3])
    assert 0.01 < away < 0.5


def test_an_action_moves_the_camera_after_the_delay():
    """0.1 m/s to the right for ten frames after one of delay: the drives lag by 15 ms."""
    env = made(scenario="still", action="twist", overrides=["run.duration=0.5"])
    actions = np.tile(np.array([0.5, 0, 0, 0], np.float32), (12, 1))
    given = steps_of(env, actions, seed=0)
    vx = np.array([seen[8] for seen, _, _ in given])
    assert np.abs(vx[:2]).max() < 1e-6
    assert vx[6:] == pytest.approx(0.1, rel=0.03)
    moved = given[-1][2]["servo_error_px"], given[0][2]["servo_error_px"]
    assert moved[0] != pytest.approx(moved[1], abs=3)


@pytest.mark.parametrize("action", ["twist", "residual"])
def test_the_laws_twist_is_told_also_where_it_has_not_decided_anew(action):
    overrides = ["run.tracker_ms=50", "run.duration=0.5"]
    env = made(scenario="line", action=action, overrides=overrides)
    actions = np.full((10, 4), 0.3, np.float32)
    twists = np.array([info["twist"] for _, _, info in steps_of(env, actions, seed=0)])
    added = 0.3 * 0.2
    assert np.abs(twists[2:, 0] - added).min() > 1e-3
    again = np.abs(np.diff(twists, axis=0)).max(axis=1) == 0
    assert again.any()  # a frame without a decision tells the twist of the last one


def test_the_reward_is_half_at_ten_pixels():
    env = made(
        scenario="still",
        vary={},
        overrides=[
            "start.x=10",
            "start.y=0",
            "start.angle_deg=0",
            "start.scale=1",
            "run.duration=0.3",
            "tracker.kind=frozen",
        ],
        action="twist",
    )
    env.reset(seed=0)
    _, reward, lost, over, told = env.step(np.zeros(4, np.float32))
    assert told["servo_error_px"] == pytest.approx(10, abs=0.2)
    assert reward == pytest.approx(0.5, abs=0.01)
    assert (lost, over) == (False, False)


def test_it_ends_when_the_target_has_left_the_picture_and_when_the_time_is_over():
    away = made(
        scenario="still",
        action="twist",
        reach=(2.0, 0.5),
        overrides=["run.duration=4", "tracker.kind=frozen"],
    )
    away.reset(seed=0)
    for _ in range(119):
        _, _, lost, over, told = away.step(np.array([1, 0, 0, 0], np.float32))
        if lost or over:
            break
    assert (lost, over) == (True, False)
    assert told["servo_error_px"] > 120
    with pytest.raises(Mistake, match=r"^step: there is no run; call reset first$"):
        away.unwrapped.step(np.zeros(4))
    short = made()
    short.reset(seed=0)
    ends = [short.step(np.zeros(4, np.float32))[2:4] for _ in range(11)]
    assert ends == [(False, False)] * 10 + [(False, True)]


def test_seeds_repeat_bit_for_bit_and_differ():
    env, rng = made(observation="both"), np.random.default_rng(0)
    actions = rng.uniform(-1, 1, (8, 4)).astype(np.float32)
    first, again, other = (steps_of(env, actions, seed=s) for s in (7, 7, 8))
    anew = steps_of(made(observation="both"), actions, seed=7)
    for a, b, c in zip(first, again, anew, strict=True):
        for x in (b, c):
            assert a[0]["features"].tobytes() == x[0]["features"].tobytes()
            assert (a[0]["picture"] == x[0]["picture"]).all()
            np.testing.assert_equal(a[1:], x[1:])
    assert first[0][2]["drawn"] != other[0][2]["drawn"]
    _, drawn = env.reset()
    assert env.reset(seed=7)[1]["seed"] == 7 != drawn["seed"]


def test_options_change_one_run():
    env = made()
    _, told = env.reset(seed=3, options={"vary": {"start.x": {"uniform": [40, 41]}}})
    assert told["drawn"].keys() == {
        "start.x",
        "start.y",
        "start.angle_deg",
        "start.scale",
        "motion.x",
        "motion.speed",
        "motion.length",
    }
    assert 40 <= told["drawn"]["start.x"] <= 41
    assert env.reset(seed=3, options={"scenario": "line", "vary": {}})[1]["drawn"] == {}
    assert abs(env.reset(seed=3)[1]["drawn"]["start.x"]) <= 60
    with pytest.raises(
        Mistake, match=r"^options: these settings change the shape of the observations; "
    ):
        made(observation="picture").reset(options={"camera": {"width": 160}})


def test_a_window_shows_each_picture(monkeypatch):
    monkeypatch.setattr(servo.gym, "has_display", lambda: True)
    monkeypatch.delenv("DISPLAY", raising=False)  # matplotlib then opens no window
    from matplotlib import pyplot

    pyplot.close("all")  # what other tests have left
    env = made(render_mode="human")
    env.reset(seed=0)
    env.step(np.zeros(4, np.float32))
    (number,) = pyplot.get_fignums()
    (image,) = pyplot.figure(number).axes[0].images
    twin = made(render_mode="rgb_array")
    twin.reset(seed=0)
    twin.step(np.zeros(4, np.float32))
    assert (image.get_array() == twin.render()).all()
    env.close()
    assert not pyplot.fignum_exists(number)


def test_without_gymnasium_the_extra_is_named(tmp_path):
    code = "import sys; sys.modules['gymnasium'] = None\nimport servo.gym"
    told = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert told.stderr.splitlines()[-1] == (
        "ModuleNotFoundError: servo.gym needs the extra 'gym': pip install 'servobench[gym]'"
    )


@pytest.mark.processes
def test_a_reset_takes_little_time():
    """30 ms CPU on the machine that it was measured on; four times as much fails."""
    env, times = made(), []
    for seed in range(12):
        began = time.process_time()
        env.reset(seed=seed)
        times.append(time.process_time() - began)
    assert np.median(times[1:]) < 0.12


@pytest.mark.processes
@pytest.mark.parametrize(("context", "count"), [("fork", 2), ("spawn", 1)])
@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
def test_environments_in_processes_give_what_one_gives(context, count):
    alone = made(observation="both")
    actions = np.random.default_rng(1).uniform(-1, 1, (5, count, 4)).astype(np.float32)
    each = range(count)
    expected = [steps_of(alone, actions[:, i], seed=10 + i) for i in each]  # it has rendered
    many = gymnasium.make_vec(
        f"servo.gym:{servo.gym.ID}",
        num_envs=count,
        vectorization_mode="async",
        vector_kwargs={"context": context},
        overrides=SHORT,
        observation="both",
    )
    seen, _ = many.reset(seed=10)
    for k in range(6):
        for i in each:
            assert (seen["features"][i] == expected[i][k][0]["features"]).all()
            assert (seen["picture"][i] == expected[i][k][0]["picture"]).all()
        if k < 5:
            seen, *_ = many.step(actions[k])
    many.close()


@pytest.mark.processes
def test_the_tutorials_policy_beats_the_law_without_an_estimator(tmp_path):
    script = tmp_path / "train_servo.py"
    script.write_text(saved_files(PAGE.read_text())[script.name])
    spec = spec_from_file_location("train_servo", script)
    tutorial = module_from_spec(spec)
    spec.loader.exec_module(tutorial)
    env = tutorial.environment(8.0)
    none, learned = (
        float(np.sqrt(np.mean(tutorial.play(env, np.array(w), seed=100)[1] ** 2)))
        for w in (np.zeros(4), tutorial.LEARNED)
    )
    assert none > 12
    assert learned < 0.5 * none


def test_settings_and_draws_reach_a_law_of_ones_own():
    def law(seen, task, *, gain=1.0):
        return np.full(6, gain * 1e-3)

    env = gymnasium.make(
        "servobench/Servo-v0",
        scenario="still",
        overrides=["run.duration=0.1", "tracker.kind=frozen"],
        controller=law,
        gain=2,
        vary={"controller.gain": {"choice": [7.0]}},
    ).unwrapped
    gains = []
    for seed, options in ((0, None), (1, None), (0, None), (1, {"gain": 5.0, "vary": {}})):
        env.reset(seed=seed, options=options)
        gains.append(env._episode.scenario.controller.gain)
    env.close()
    assert gains == [2, 7.0, 2, 5.0]


def test_each_shipped_scenario_has_an_id_that_needs_no_import():
    code = (
        "import gymnasium; env = gymnasium.make('servo.gym:servobench/Arm7Line-v0'); "
        "print(env.unwrapped._base.name)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "arm7_line\n"
    ids = {servo.gym.environment_id(name) for name in shipped()}
    assert ids <= gymnasium.registry.keys()


def test_reset_tells_the_picture_at_the_goal():
    """It is the picture of a run that begins there."""
    told = made(scenario="still", goal_picture=True).reset(seed=0)[1]["goal_picture"]
    there = made(scenario="still", start={}, vary={}, observation="picture").reset(seed=0)[0]
    np.testing.assert_array_equal(told, there)
    assert "goal_picture" not in made().reset(seed=0)[1]


def test_success_is_a_mean_distance_of_the_corners_within_ten_pixels():
    env = made(scenario="still", overrides=["run.duration=3"])
    infos = [i for _, _, i in steps_of(env, [np.zeros(4)] * 60, seed=0)]
    assert [i["is_success"] for i in infos] == [i["distance_px"] <= 10 for i in infos]
    assert not infos[0]["is_success"]
    assert infos[-1]["is_success"]


def test_the_reward_is_made_of_the_terms_that_are_told():
    env = made(scenario="plate_line", overrides=["run.duration=0.5", "start.tilt_deg=10"])
    for _, reward, info in steps_of(env, [np.zeros(4)] * 5, seed=3)[1:]:
        assert list(info["reward_terms"]) == [f"corner_{i}_px" for i in (1, 2, 3, 4)]
        distances = list(info["reward_terms"].values())
        assert np.ptp(distances) > 0.1
        assert reward == pytest.approx(1 / (1 + np.mean(distances) / 10), rel=1e-12)


def test_a_policy_may_learn_inside_a_recording():
    env = made(scenario="recording", overrides=["run.duration=0.4"], tracker="truth")
    env.reset(seed=3)
    *_, reward, _, _, _ = env.step(np.zeros(env.action_space.shape, np.float32))
    assert 0 < reward <= 1
    env.close()
