"""A run of a benchmark: one contestant in one world, as a job of a study."""

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from servo.bench.benchmark import HELD_SHARE, HELD_SIZE, Benchmark, Settings, World
from servo.bench.contestant import Contestant
from servo.loop.columns import Columns
from servo.loop.episode import Episode
from servo.loop.part_failures import PartFailed
from servo.loop.step import Step
from servo.scenario.load import Scenario, parse
from servo.scenario.toml import Table
from servo.study.run import Job, Record
from servo.study.scenario_run import Sheet, record_of
from sim.channels import Channel, needs_of
from sim.types import Array, Image
from sim.world import Unstable
from tracking.types import SEES_PICTURES

CONTESTANT = "contestant"
WORLD = "world"
SLOW = "slow"
"""Settings of a job: the contestant, the world, and the tracker's time for a picture [ms], or 0."""
PICTURE = "first_picture"
LAST = "last_picture"
"""Settings of a record: the SHA-256 of the first and the last picture of the run."""
ERROR = "error_sizes"
"""Series of a record: distance of the target's centre from the goal, in target sizes."""


@dataclass(frozen=True, slots=True)
class WorldRun:
    """A subject of jobs: a contestant in a world."""

    benchmark: str
    """Its name and hash."""
    name: str
    """The condition."""
    table: Table

    def describe(self) -> dict[str, Any]:
        """Return the benchmark's version, and the scenario's table."""
        return {"benchmark": self.benchmark, "scenario": self.table}

    def perform(self, job: Job, folder: Path) -> Record:
        """Run the contestant."""
        del folder
        scenario = parse(self.table, str(job.settings[WORLD]), self.benchmark)
        sheet = Sheet(scenario.frames)
        pictures: list[Image] = []

        def keep(step: Step) -> None:
            sheet.add(step)
            pictures[1:] = [step.frame.image]

        looks = Channel.PICTURE in needs_of(scenario.tracker, SEES_PICTURES)
        run = _run(scenario, keep if looks else None)
        record = record_of(job, scenario, run)
        digests = [hashlib.sha256(picture.tobytes()).hexdigest() for picture in pictures]
        first, last = (digests[0], digests[-1]) if digests else ("", "")
        errors = errors_of(run, scenario.frames)
        failed = looks and float(np.mean(errors <= HELD_SIZE)) < HELD_SHARE
        return replace(
            record,
            settings=record.settings | {PICTURE: first, LAST: last},
            series={ERROR: errors.astype(np.float32)},
            sheet=sheet.jpeg() if failed else None,
        )


def _run(scenario: Scenario, each: Callable[[Step], None] | None) -> Columns:
    """Return the columns of a run; they end where the simulation becomes unstable."""
    run = Columns()
    with Episode(scenario, seen=each is not None) as episode:
        try:
            for step in episode:
                if each is not None:
                    each(step)
                run.add(step)
        except PartFailed as failed:
            if not isinstance(failed.__cause__, Unstable):
                raise
    return run


def errors_of(run: Columns, frames: int) -> Array:
    """Return how far the target's centre is from the goal (frames,), in sizes of the target.

    Its size is that at the goal, the square root of its area [px]. A picture that a run did not
    reach, or in which the target is behind the camera, is infinitely far.
    """
    x, y = run.first.truth.corners.T
    area = 0.5 * abs(np.dot(x, np.roll(y, 1)) - np.dot(y, np.roll(x, 1)))
    metres = np.sqrt(area) / run.first.truth.size
    found = np.full(frames, np.inf)
    found[: len(run)] = run["servo"] / (metres * run["goal_size"])
    return np.where(np.isnan(found), np.inf, found)


def jobs_of(
    benchmark: Benchmark, contestants: Sequence[Contestant], worlds: Sequence[World]
) -> list[Job]:
    """Return the jobs of some contestants in some worlds, those with slower trackers included."""
    of = f"{benchmark.name} {benchmark.hash}"
    slow = benchmark.slow
    found = list[Job]()
    for one in contestants:
        for world in worlds:
            late: list[tuple[float, Settings]] = [(0.0, {})]
            if slow and one.is_compared and world.condition == slow.condition:
                late += [(ms, {slow.setting: ms}) for ms in slow.values]
            for ms, settings in late:
                table = benchmark.table_of(world, one.settings | settings)
                subject = WorldRun(of, world.condition, table)
                who: Table = {CONTESTANT: one.name, WORLD: world.key, SLOW: ms}
                found.append(Job(len(found), subject, world.seed, who))
    return found
