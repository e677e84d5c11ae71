"""A plugin of pytest: `pytest --servobench scenes/` makes each scenario file with bounds a test."""

from __future__ import annotations

import tomllib
from argparse import ArgumentTypeError
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

OPTION = "--servobench"
SEEDS = "--servobench-seeds"


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options."""
    group = parser.getgroup("servobench")
    group.addoption(OPTION, action="store_true", help="Test the bounds of scenario files (.toml).")
    group.addoption(SEEDS, type=_count, default=1, metavar="N", help="Number of seeds, from 0 on.")


def _count(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise ArgumentTypeError(f"expected a number from 1 on, got {text}")
    return int(text)


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> pytest.Collector | None:
    """Take the TOML files that have bounds, and those that are no TOML."""
    if not parent.config.getoption(OPTION) or file_path.suffix != ".toml":
        return None
    try:
        bounds = tomllib.loads(file_path.read_text("utf-8")).get("expect")
    except (tomllib.TOMLDecodeError, UnicodeDecodeError):
        bounds = True  # its test says what is wrong
    return ScenarioFile.from_parent(parent, path=file_path) if bounds else None


class ScenarioFile(pytest.File):
    """A scenario file; a test for each seed."""

    def collect(self) -> Iterator[ScenarioTest]:
        count: Any = self.config.getoption(SEEDS)
        for seed in range(count):
            test = ScenarioTest.from_parent(self, name=f"{self.path.stem}[{seed}]")
            test.seed = seed
            yield test


class ScenarioTest(pytest.Item):
    """A run of a scenario, which must keep its bounds."""

    seed: int

    def runtest(self) -> None:
        from servo.output.formats import command_line
        from servo.scenario.load import load
        from servo.study.bounds import check_expect
        from servo.study.run import Job
        from servo.study.scenario_run import LoadedScenario

        scenario = load(str(self.path), seed=self.seed)
        check_expect(scenario)
        command = command_line("run", str(self.path), seed=self.seed)
        record = Job(0, LoadedScenario(scenario), self.seed, command=command).run(Path())
        if record.missed:
            raise MissedBounds("\n".join(f"missed: {m}" for m in record.missed))

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> str:
        """The sentence, and the command that repeats the run."""
        from servo.mistake import Mistake
        from servo.output.formats import command_line

        if not isinstance(excinfo.value, (MissedBounds, Mistake)):
            return str(super().repr_failure(excinfo, style))
        again = command_line("run", str(self.path), seed=self.seed)
        return f"{excinfo.value}\n  again: {again}"

    def reportinfo(self) -> tuple[Path, None, str]:
        return self.path, None, self.name


class MissedBounds(AssertionError):
    """The bounds that a run did not keep."""
