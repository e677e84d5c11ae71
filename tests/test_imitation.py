"""The tutorial imitate_a_law.md: what it records, what its network learns, and what it writes."""

import json
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import gymnasium
import h5py
import numpy as np
import pytest
from tutorial_pages import saved_files

import servo

PAGE = Path(__file__).parents[1] / "servo" / "tutorials" / "imitate_a_law.md"


@pytest.fixture(scope="module")
def tutorial(tmp_path_factory):
    """The folder with the page's files, two demonstrations, and the page's modules by name."""
    folder = tmp_path_factory.mktemp("imitate")
    modules = {}
    for file, content in saved_files(PAGE.read_text()).items():
        (folder / file).write_text(content)
        if file.endswith(".py"):
            spec = spec_from_file_location(f"page_{file[:-3]}", folder / file)
            modules[file[:-3]] = module_from_spec(spec)
            spec.loader.exec_module(modules[file[:-3]])
    modules["record"].record(folder / "demos.hdf5", str(folder / "imitate.toml"), (3, 4))
    return folder, modules


def test_demonstrations_are_what_the_law_did(tutorial):
    folder, _ = tutorial
    with h5py.File(folder / "demos.hdf5") as file:
        data = file["data"]
        assert sorted(data) == ["demo_0", "demo_1"]
        assert data.attrs["total"] == 28
        assert json.loads(data.attrs["env_args"])["env_name"] == "servobench/Servo-v0"
        demo = data["demo_1"]
        scenario = servo.load(folder / "imitate.toml", seed=4)
        steps = list(servo.run(scenario))[:-1]
        np.testing.assert_array_equal(demo["actions"], [s.command.twist for s in steps])
        np.testing.assert_array_equal(demo["obs/picture"], [s.frame.image for s in steps])
        np.testing.assert_array_equal(demo["obs/joints"], [s.joints for s in steps])
        assert json.loads(demo.attrs["drawn"]) == scenario.drawn
        assert demo["rewards"].shape == (14,)
        assert demo["dones"][:].tolist() == [0] * 13 + [1]
        assert demo.attrs["num_samples"] == 14
        at_goal = next(servo.run(servo.load(folder / "imitate.toml", vary={}))).frame.image
        np.testing.assert_array_equal(demo["goal_picture"], at_goal)


def test_the_environment_of_a_recording_replays_it(tutorial):
    folder, _ = tutorial
    with h5py.File(folder / "demos.hdf5") as file:
        told = json.loads(file["data"].attrs["env_args"])
        demo = file["data/demo_1"]
        env = gymnasium.make(f"servo.gym:{told['env_name']}", **told["env_kwargs"])
        picture, _ = env.reset(seed=4)
        for action, seen, reward in zip(
            demo["actions"], demo["obs/picture"], demo["rewards"], strict=True
        ):
            np.testing.assert_array_equal(picture, seen)
            picture, got, *_ = env.step(action)
            assert got == pytest.approx(reward, abs=1e-9)


def test_the_network_fits_what_it_learns_from_and_stands_still_at_the_goal(tutorial):
    folder, modules = tutorial
    imitate = modules["imitate"]
    inputs, twists = imitate.examples(folder / "demos.hdf5")
    A, a, B, b = imitate.train(inputs, twists, epochs=600)
    assert sum(each.size for each in (A, a, B, b)) == 4782
    left = twists - (np.tanh(inputs @ A + a) @ B + b)
    assert (left.std(axis=0) < 0.1 * twists.std(axis=0)).all()
    np.testing.assert_allclose(np.tanh(a) @ B + b, 0, atol=1e-7)


def test_the_file_that_it_writes_does_what_was_learned(tutorial):
    folder, modules = tutorial
    imitate = modules["imitate"]
    rng = np.random.default_rng(0)
    shapes = (192, imitate.HIDDEN), (imitate.HIDDEN,), (imitate.HIDDEN, 6), (6,)
    A, a, B, b = (rng.normal(0, 0.05, shape).astype(np.float32) for shape in shapes)
    imitate.write(folder / "policy.onnx", A, a, B, b)
    learned = [
        "tracker.kind=frozen",
        f"controller={{ kind = 'onnx', file = '{folder}/policy.onnx' }}",
    ]
    (step, *_) = servo.run(servo.load(folder / "imitate.toml", learned, 3))
    with h5py.File(folder / "demos.hdf5") as file:
        goal = imitate.grey(file["data/demo_0/goal_picture"][:])
    x = 4 * (imitate.grey(step.frame.image) - goal)
    np.testing.assert_allclose(step.command.twist, np.tanh(x @ A + a) @ B + b, rtol=1e-4, atol=1e-6)


def test_the_comparison_counts_by_both_rules(tutorial, monkeypatch, capsys):
    folder, modules = tutorial
    compare = modules["compare"]
    found = {0: (5.0, 0.5, 80.0), 1: (9.0, 2.0, 80.0), 2: (5.0, 0.5, 20.0), 3: (90.0, 0.1, 100.0)}
    monkeypatch.setattr(compare, "ends", lambda seed, law, start: found[seed])
    compare.compare(range(4))
    line = "near, pose: 2 of 4 (0.15 to 0.85); CNS 1 of 4 (0.05 to 0.70); median 7.0 mm, 0.50 deg"
    assert line in capsys.readouterr().out
    monkeypatch.undo()
    monkeypatch.chdir(folder)
    mm, deg, way = compare.ends(3, [], {})
    assert mm < 2
    assert deg < 0.2
    assert 20 < way < 130
