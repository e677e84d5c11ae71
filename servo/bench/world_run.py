"""A run of a benchmark: one contestant in one world (random scenario), as a job of a study."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from servo.bench.benchmark import Benchmark, Settings, World
from servo.bench.contestant import Contestant, Division
from servo.bench.world_score import ERROR, LAST, PICTURE, world_score
from servo.loop.columns import Columns
from servo.loop.episode import Episode
from servo.loop.part_failures import PartFailed
from servo.scenario.load import parse
from servo.scenario.toml import Table
from servo.study.run import Job, Record
from servo.study.scenario_run import Sheet, record_of
from sim.channels import Channel
from sim.types import Array, Image
from sim.world import Unstable

CONTESTANT = "contestant"
WORLD = "world"
SLOW = "slow"
"""Settings of a job: the contestant, the world, and the tracker's time for a picture [ms], or 0."""


@dataclass(frozen=True, slots=True)
class WorldRun:
    """The run of a contestant (tracker or control law) in one world (random scenario) of a
    benchmark, as the subject of a study's job: the scenario's table includes the contestant's
    settings.
    """

    benchmark: str
    """Name and hash of the benchmark."""
    name: str
    """Name of the condition."""
    score: str
    """The benchmark's kind of score, by which a run fails."""
    table: Table
    """The scenario's TOML table."""

    def describe(self) -> Table:
        """Return the benchmark's name and hash by the key "benchmark", and the scenario's table by
        "scenario".
        """
        return {"benchmark": self.benchmark, "scenario": self.table}

    def perform(self, job: Job, folder: Path) -> Record:
        """Run the contestant in the world, and return the record: its measures, the error in each
        picture [target sizes], and digests of the first and last picture. If a contestant that sees
        pictures does not hold the target, or does not arrive (whichever the benchmark scores), the
        record has an image with pictures of the run. If the
        simulation becomes unstable, the run ends there.

        No file is written into `folder`.

        Raises:
            PartFailed: A component, such as the tracker, raised an exception.
        """
        scenario = parse(self.table, str(job.settings[WORLD]), self.benchmark)
        sheet = Sheet(scenario.frames)
        pictures: list[Image] = []
        run = Columns()
        looks = Channel.PICTURE in scenario.needs
        with Episode(scenario, seen=looks) as episode:
            try:
                for step in episode:
                    if looks:
                        sheet.add(step)
                        pictures[1:] = [step.frame.image]  # the first and the last
                    run.add(step)
            except PartFailed as failed:
                if not isinstance(failed.__cause__, Unstable):  # else the run ends here
                    raise
        record = record_of(job, scenario, run)
        digests = [hashlib.sha256(picture.tobytes()).hexdigest() for picture in pictures]
        first, last = (digests[0], digests[-1]) if digests else ("", "")
        record = replace(
            record,
            settings=record.settings | {PICTURE: first, LAST: last},
            series={ERROR: errors_of(run, scenario.frames).astype(np.float32)},
        )
        failed = looks and not world_score(self.score, record).held
        return replace(record, sheet=sheet.jpeg()) if failed else record


def errors_of(run: Columns, frames: int) -> Array:
    """Return the distance, in each picture, of the target's true centre from its goal (frames,)
    [target sizes].

    A target size is the square root of the target's area in the goal picture. The distance is
    infinite in pictures that the run did not reach, and where the target is behind the camera.

    Args:
        run: Columns of all steps of the run.
        frames: Number of pictures of a complete run.
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
    """Return a job for each contestant in each world (random scenario). In the worlds of the
    condition that `benchmark.slow` names, each contestant but the reference ones ("still" and
    "truth") also has a job for each time that a slowed tracker takes for a picture.
    """
    of = f"{benchmark.name} {benchmark.hash}"
    slow = benchmark.slow
    found = list[Job]()
    for one in contestants:
        for world in worlds:
            late: list[tuple[float, Settings]] = [(0.0, {})]
            is_ranked = one.division is not Division.SCALE
            if slow and is_ranked and world.condition == slow.condition:
                late.extend((ms, {slow.setting: ms}) for ms in slow.values)
            for ms, settings in late:
                table = benchmark.table_of(world, one.settings | settings)
                subject = WorldRun(of, world.condition, benchmark.score, table)
                who: Table = {CONTESTANT: one.name, WORLD: world.key, SLOW: ms}
                found.append(Job(len(found), subject, world.seed, who))
    return found
