"""Absurd input is refused in one sentence that names the limit, over all settings."""

import dataclasses
import sys
from typing import Annotated, get_args, get_origin, get_type_hints

import pytest
from annotated_types import Ge, Gt, Le, Lt

from servo.cli import main
from servo.mistake import Mistake
from servo.scenario import load as s
from servo.scenario.catalogue import LISTS, PLUGINS
from servo.study import execute as workers
from servo.study.suites import GENERATORS

FOLDERS = [*(folder for folder, _ in PLUGINS.values()), *LISTS.values(), GENERATORS]
CONFIGS = [*s.SECTIONS.values()]
CONFIGS += [folder.config_of(kind) for folder in FOLDERS for kind in folder.names()]


def numbers(config):
    """Names of all settings that are numbers, those of tables inside too, with their limits."""
    for name, hint in get_type_hints(config, include_extras=True).items():
        if dataclasses.is_dataclass(hint):
            yield from numbers(hint)
        for limits in limits_of(hint):
            yield f"{config.__module__}.{config.__name__}.{name}", limits


def limits_of(hint):
    """The limits of each number in a type: of x | None, and of each part of a tuple, too."""
    if get_origin(hint) is Annotated:
        kind, *limits = get_args(hint)
        if kind in (int, float):
            yield limits
    elif hint in (int, float):
        yield []
    else:
        for part in get_args(hint):
            yield from limits_of(part)


@pytest.mark.parametrize("config", CONFIGS, ids=lambda c: f"{c.__module__}.{c.__name__}")
def test_every_number_has_a_largest_and_a_smallest_value(config):
    for name, limits in numbers(config):
        assert any(isinstance(limit, Ge | Gt) for limit in limits), name
        assert any(isinstance(limit, Le | Lt) for limit in limits), name


def test_the_walk_finds_the_numbers():
    found = [name for config in CONFIGS for name, _ in numbers(config)]
    for name in (
        "CameraConfig.width",
        "RunConfig.seed",
        "annealed.Config.particles",
        "kams.Config.layers",
        "RunConfig.duration",
        "GoalConfig.depth_to",
        "ibvs.Config.acceleration",
        "kalman_cv.Config.ratio",
    ):
        assert any(one.endswith(name) for one in found), name
    assert sum(name.endswith("ibvs.Config.weights") for name in found) == 6


ABSURD = {
    "tracker.particles=1000000000": (
        "tracker.particles = 1000000000: input should be less than or equal to 100000"
    ),
    "camera.width=1000000": "camera.width = 1000000: input should be less than or equal to 2560",
    "camera.height=1000000": "camera.height = 1000000: input should be less than or equal to 1920",
    "camera.rate=1e9": "camera.rate = 1000000000.0: input should be less than or equal to 1000",
    "world.physics_rate=1e9": (
        "world.physics_rate = 1000000000.0: input should be less than or equal to 100000"
    ),
    "world.drive_rate=5e-324": (
        "world.drive_rate = 5e-324: input should be greater than or equal to 0.1"
    ),
    "run.duration=1e9": "run.duration = 1000000000.0: input should be less than or equal to 3600",
    "run.latency=1000": "run.latency = 1000: input should be less than or equal to 100",
    "run.seed=99999999999999999999": "an integer has more than 64 bits; give one from -9223372036854775808 to 9223372036854775807",
    "run.seed=9223372036854775808": "an integer has more than 64 bits; give one from -9223372036854775808 to 9223372036854775807",
    "goal.x=1e300": "goal.x = 1e+300: input should be less than or equal to 10000",
    "motion={kind='stop_and_go', go=1e-9}": (
        "motion.go = 1e-09: input should be greater than or equal to 0.1"
    ),
    "controller.acceleration=5e-324": (
        "controller.acceleration = 5e-324: input should be greater than or equal to 0.001"
    ),
    "estimator={noise='difference', ratio=5e-324}": (
        "estimator.ratio = 5e-324: input should be greater than or equal to 0.000000001"
    ),
    "estimator={kind='kalman_ca', acceleration_ratio=1e308}": (
        "estimator.acceleration_ratio = 1e+308: input should be less than or equal to 1000000000"
    ),
    "controller.coast=1e308": (
        "controller.coast = 1e+308: input should be less than or equal to 3600"
    ),
    "tracker.levels=1": "tracker.levels = 1: input should be greater than or equal to 2",
    "tracker={kind='texture_pf', levels=33}": (
        "tracker.levels = 33: input should be less than or equal to 32"
    ),
    "tracker={kind='kams', layers=1000000}": (
        "tracker.layers = 1000000: input should be less than or equal to 50"
    ),
    "camera.rate=1000 run.duration=3600": (
        "run.duration = 3600 s at camera.rate = 1000 Hz is 3,600,000 frames; the limit is 360,000: shorten the run, or lower the rate"
    ),
}


TOGETHER = "run.duration=3600"
"""The change that goes too far, of two."""


@pytest.mark.parametrize("changes", ABSURD)
def test_what_is_absurd_is_refused_with_its_limit(changes):
    items = [changes] if "{" in changes else changes.split()
    with pytest.raises(Mistake) as refused:
        s.load("line", items)
    culprit = TOGETHER if changes == f"camera.rate=1000 {TOGETHER}" else changes
    assert str(refused.value) == f"--set {culprit}: {ABSURD[changes]}"


def test_an_hour_at_100_frames_a_second_is_allowed():
    assert s.load("line", ["run.duration=3600", "camera.rate=100"]).run.duration == 3600


def call(monkeypatch, capfd, *arguments):
    monkeypatch.setattr(sys, "argv", ["servobench", *arguments])
    with pytest.raises(SystemExit) as ended:
        main.main()
    return ended.value.code, capfd.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ["run", "line", "--set", "tracker.particles=1000000000"],
            "--set tracker.particles=1000000000: tracker.particles = 1000000000: input should be "
            "less than or equal to 100000",
        ),
        (
            ["check", "line", "--seeds", "1000000000000"],
            f"this command would make 1,000,000,000,000 runs; the limit is {workers.MOST_RUNS:,}: make fewer at a time",
        ),
        (
            ["evaluate", "clutter", "--trackers", "kams", "--seeds", "1000000000000"],
            f"this command would make 4,000,000,000,000 runs; the limit is {workers.MOST_RUNS:,}: make fewer at a time",
        ),
        (
            ["evaluate", "closed_loop", "--trackers", "kams", "--seeds", "1000000000000"],
            "--seeds 1000000000000: give at most 1,000,000",
        ),
    ],
)
def test_the_command_line_exits_2_and_writes_nothing(
    monkeypatch, capfd, tmp_path, arguments, message
):
    monkeypatch.chdir(tmp_path)
    assert call(monkeypatch, capfd, *arguments) == (2, f"servobench: {message}\n")
    assert list(tmp_path.iterdir()) == []
