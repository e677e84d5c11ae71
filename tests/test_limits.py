"""Absurd input is refused in one sentence that names the limit, over all settings."""

import dataclasses
import sys
from typing import Annotated, get_args, get_origin, get_type_hints

import pytest
from annotated_types import Ge, Gt, Le, Lt

from servo import batch, cli
from servo import scenario as s
from servo.catalogue import LISTS, PLUGINS
from servo.mistake import Mistake
from servo.suites import GENERATORS
from sim import plugins

FOLDERS = [*(folder for folder, _ in PLUGINS.values()), *LISTS.values(), GENERATORS]
CONFIGS = [*s.SECTIONS.values()]
CONFIGS += [plugins.config_of(folder, kind) for folder in FOLDERS for kind in plugins.kinds(folder)]
WITHOUT_LIMIT: dict[str, str] = {}
"""Whole numbers that need no upper limit, CLASS.FIELD, and why: none so far."""


def whole_numbers(config):
    """Names of all int settings, those of tables inside included, with their limits."""
    for name, hint in get_type_hints(config, include_extras=True).items():
        if dataclasses.is_dataclass(hint):
            yield from whole_numbers(hint)
        for part in (hint, *get_args(hint)):
            kind, *limits = get_args(part) if get_origin(part) is Annotated else (part,)
            if kind is int and (get_origin(part) is Annotated or part is hint):
                yield f"{config.__module__}.{config.__name__}.{name}", limits


@pytest.mark.parametrize("config", CONFIGS, ids=lambda c: f"{c.__module__}.{c.__name__}")
def test_every_whole_number_has_a_largest_and_a_smallest_value(config):
    for name, limits in whole_numbers(config):
        assert any(isinstance(limit, Ge | Gt) for limit in limits), name
        assert any(isinstance(limit, Le | Lt) for limit in limits) or name in WITHOUT_LIMIT, name


def test_the_walk_finds_the_whole_numbers():
    found = {name.split(".", 2)[-1] for config in CONFIGS for name, _ in whole_numbers(config)}
    for name in (
        "CameraConfig.width",
        "RunConfig.seed",
        "LockConfig.history",
        "annealed.Config.layers",
    ):
        assert any(one.endswith(name) for one in found), name


ABSURD = {
    "tracker.particles=1000000000": (
        "tracker.particles = 1000000000: input should be less than or equal to 100000"
    ),
    "camera.width=1000000": "camera.width = 1000000: input should be less than or equal to 2560",
    "camera.height=1000000": "camera.height = 1000000: input should be less than or equal to 1920",
    "camera.rate=1e9": "camera.rate = 1000000000.0: input should be less than or equal to 1000",
    "camera.subframes=1000": "camera.subframes = 1000: input should be less than or equal to 64",
    "camera.supersample=99": "camera.supersample = 99: input should be less than or equal to 4",
    "world.physics_rate=1e9": (
        "world.physics_rate = 1000000000.0: input should be less than or equal to 100000"
    ),
    "world.drive_rate=5e-324": (
        "world.drive_rate = 5e-324: input should be greater than or equal to 0.1"
    ),
    "run.duration=1e9": "run.duration = 1000000000.0: input should be less than or equal to 3600",
    "run.latency=1000": "run.latency = 1000: input should be less than or equal to 100",
    "run.seed=99999999999999999999": "an integer is too large; the limit is 9223372036854775807",
    "goal.x=1e300": "goal.x = 1e+300: input should be less than or equal to 10000",
    "motion={kind='spin', turn_duration=1e-9}": (
        "motion.turn_duration = 1e-09: input should be greater than or equal to 0.1"
    ),
    "tracker.levels=3": "tracker.levels = 3: input should be 2, 4, 8, 16 or 32",
    "tracker={kind='texture_pf', levels=32}": (
        "tracker.levels = 32: input should be 2, 4, 8 or 16"
    ),
    "tracker.lock.history=1000000": (
        "tracker.lock.history = 1000000: input should be less than or equal to 10000"
    ),
    "camera.rate=1000 run.duration=3600": (
        "run.duration = 3600 s at camera.rate = 1000 Hz is 3,600,000 frames; the limit is 360,000"
    ),
}


@pytest.mark.parametrize("changes", ABSURD)
def test_what_is_absurd_is_refused_with_its_limit(changes):
    items = [changes] if "{" in changes else changes.split()
    with pytest.raises(Mistake) as refused:
        s.load("line", items)
    assert str(refused.value) == f"line.toml: {ABSURD[changes]}"


def test_an_hour_at_100_frames_a_second_is_allowed():
    assert s.load("line", ["run.duration=3600", "camera.rate=100"]).run.duration == 3600


def call(monkeypatch, capfd, *arguments):
    monkeypatch.setattr(sys, "argv", ["servobench", *arguments])
    with pytest.raises(SystemExit) as ended:
        cli.main()
    return ended.value.code, capfd.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ["run", "line", "--set", "tracker.particles=1000000000"],
            "line.toml: tracker.particles = 1000000000: input should be less than or equal to "
            "100000",
        ),
        (
            ["check", "line", "--seeds", "1000000000000"],
            f"these are 1,000,000,000,000 runs; the limit is {batch.MOST_RUNS:,}",
        ),
        (
            ["bench", "clutter", "--trackers", "kams", "--seeds", "1000000000000"],
            f"these are 4,000,000,000,000 runs; the limit is {batch.MOST_RUNS:,}",
        ),
        (
            ["bench", "closed_loop", "--trackers", "kams", "--seeds", "1000000000000"],
            f"these are 2,000,000,000,000 runs; the limit is {batch.MOST_RUNS:,}",
        ),
    ],
)
def test_the_command_line_exits_2_and_writes_nothing(
    monkeypatch, capfd, tmp_path, arguments, message
):
    monkeypatch.chdir(tmp_path)
    assert call(monkeypatch, capfd, *arguments) == (2, f"servobench: {message}\n")
    assert list(tmp_path.iterdir()) == []
