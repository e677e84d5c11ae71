"""A plugin of pytest: `pytest --servobench scenes/` makes each scenario file with bounds a test.

pytest loads it in every repository, also where a folder hides one of our packages. So it is
installed as a module of its own, `servobench_pytest`, and imports ours in tests only.
"""

from __future__ import annotations

import tomllib
from argparse import ArgumentTypeError
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from servo.scenario.load import Scenario
    from servo.study.run import Record

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
        bounds: Any = tomllib.loads(file_path.read_text("utf-8")).get("expect")
    except (tomllib.TOMLDecodeError, UnicodeDecodeError):
        bounds = True  # its test says what is wrong
    if not bounds:
        return None
    file = ScenarioFile.from_parent(parent, path=file_path)
    file.drawn = isinstance(bounds, dict) and "drawn" in bounds
    return file


class ScenarioFile(pytest.File):
    """A scenario file; a test for each seed, and one for the share of those that have drawn."""

    drawn: bool

    def collect(self) -> Iterator[ScenarioTest | ShareTest]:
        self.ends: dict[int, tuple[Scenario, Record]] = {}
        count: Any = self.config.getoption(SEEDS)
        for seed in range(count):
            test = ScenarioTest.from_parent(self, name=f"{self.path.stem}[{seed}]")
            test.seed = seed
            yield test
        if self.drawn and count > 1:
            yield ShareTest.from_parent(self, name=f"{self.path.stem}[drawn]")

    def end_of(self, seed: int) -> tuple[Scenario, Record]:
        """Return the scenario of a seed and the record of its run, which is done once."""
        from servo.output.formats import command_line
        from servo.scenario.load import load
        from servo.study.bounds import check_expect
        from servo.study.run import Job
        from servo.study.scenario_run import LoadedScenario

        if seed not in self.ends:
            scenario = load(str(self.path), seed=seed)
            check_expect(scenario)
            command = command_line("run", str(self.path), seed=seed)
            job = Job(0, LoadedScenario(scenario), seed, command=command)
            self.ends[seed] = scenario, job.run(Path())
        return self.ends[seed]


class ScenarioTest(pytest.Item):
    """A run of a scenario, which must keep its bounds."""

    parent: ScenarioFile
    seed: int

    def runtest(self) -> None:
        from servo.study.bounds import missed_lines

        _, record = self.parent.end_of(self.seed)
        if record.missed:
            lines = missed_lines(record.missed, record.measures)
            raise MissedBounds("\n".join(f"missed: {line}" for line in lines))

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> str:
        """The sentence, and the command that repeats the run."""
        if isinstance(excinfo.value, ImportError):  # one of our packages is hidden
            return str(excinfo.value)
        from servo.mistake import Mistake
        from servo.output.formats import command_line

        if not isinstance(excinfo.value, (MissedBounds, Mistake)):
            return str(super().repr_failure(excinfo, style))
        again = command_line("run", str(self.path), seed=self.seed)
        return f"{excinfo.value}\n  again: {again}"

    def reportinfo(self) -> tuple[Path, None, str]:
        return self.path, None, self.name


class ShareTest(pytest.Item):
    """The runs of the seeds that have drawn, of which enough must end as expected."""

    parent: ScenarioFile

    def runtest(self) -> None:
        from servo.study.bounds import DrawnShare

        count: Any = self.config.getoption(SEEDS)
        ends = [self.parent.end_of(seed) for seed in range(count)]
        share = DrawnShare.of([(scenario, record.success) for scenario, record in ends])
        if share is not None and share.missed:
            raise MissedBounds(f"missed: {share}")

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> str:
        """The sentence, and the command that repeats the runs."""
        from servo.output.formats import command_line

        if not isinstance(excinfo.value, MissedBounds):
            return str(super().repr_failure(excinfo, style))
        count: Any = self.config.getoption(SEEDS)
        again = command_line("check", str(self.path), seeds=count)
        return f"{excinfo.value}\n  again: {again}"

    def reportinfo(self) -> tuple[Path, None, str]:
        return self.path, None, self.name


class MissedBounds(AssertionError):
    """The bounds that a run did not keep."""
