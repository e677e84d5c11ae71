"""A run of a benchmark: one contestant in one world (random scenario), as a job of a study."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from servo.bench.benchmark import (
    EQUAL_DEG,
    EQUAL_DEPTH,
    Benchmark,
    Settings,
    WhatError,
    World,
)
from servo.bench.contestant import Contestant, Division
from servo.bench.world_score import ERROR, LAST, PICTURE, world_score
from servo.loop.columns import Columns
from servo.loop.episode import Episode
from servo.loop.part_failures import Part, PartFailed
from servo.loop.settings import stream
from servo.scenario.load import Scenario, parse
from servo.scenario.toml import Table
from servo.study.run import Job, Record
from servo.study.scenario_run import Sheet, record_of
from sim.channels import Channel
from sim.outline import area
from sim.types import Array, Image
from sim.world import Unstable
from tracking.evaluation.track_measures import turned_overlaps
from tracking.types import Tracker

CONTESTANT = "contestant"
WORLD = "world"
SLOW = "slow"
"""Settings of a job: the contestant, the world, and the tracker's time for a picture [ms], or 0."""
OVERLAP = "open_loop_iou"
WITHIN = "open_loop_within_pct"
"""Measures of a tracker that does not steer the camera: overlap, and share of pictures [%] in which
its centre is near the true one."""
NEAR = 0.5
"""Largest distance of a tracker's centre from the true one that counts as near [target sizes]."""


@dataclass(frozen=True, slots=True)
class WorldRun:
    """The run of a contestant (tracker or control law) in one world (random scenario) of a
    benchmark, as the subject of a study's job: the scenario's table includes the contestant's
    settings. With a `driver` the contestant also gets the pictures of a run in the same world in
    which a reference tracker steers the camera.
    """

    benchmark: str
    """Name and hash of the benchmark."""
    name: str
    """Name of the condition."""
    score: str
    """The benchmark's kind of score, which decides whether a run has failed."""
    error: WhatError
    """What the error covers: the target's centre, its size too, or all of it."""
    table: Table
    """The scenario's TOML table."""
    driver: Table | None = None
    """Table of the same world in which another tracker steers the camera: the contestant also gets
    its pictures. None: it does not."""

    def describe(self) -> Table:
        """Return the benchmark's name and hash by the key "benchmark", and the scenario's table by
        "scenario".
        """
        return {"benchmark": self.benchmark, "scenario": self.table}

    def perform(self, job: Job, folder: Path) -> Record:
        """Run the contestant in the world, and return the record: its measures, the error in each
        picture [target sizes], and digests of the first and last picture ("": no component used
        pictures). If a contestant that sees pictures does not hold the target, or does not arrive
        (whichever the benchmark scores), the record has an image with pictures of the run. If the
        simulation becomes unstable, the run ends there.

        No file is written into `folder`.

        Raises:
            PartFailed: A component, such as the tracker, raised an exception, or the tracker raised
                one in the run in which `driver` steers the camera.
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
            measures=record.measures | self._open_loop(scenario, job),
            series={ERROR: errors_of(run, scenario.frames, self.error).astype(np.float32)},
        )
        failed = looks and not world_score(self.score, record).held
        return replace(record, sheet=sheet.jpeg()) if failed else record

    def _open_loop(self, scenario: Scenario, job: Job) -> dict[str, float]:
        """Return how well the contestant follows the target in the pictures of a camera that
        `driver` steers, over all pictures but the first: its mean overlap with the truth
        (intersection over union), and the share of pictures [%] in which its centre is at most half
        a target size from the true one. Return an empty dictionary without a driver.

        Raises:
            PartFailed: The contestant raised an exception, or returned an invalid value.
        """
        if self.driver is None:
            return {}
        part = Part("tracker", scenario.tracker)
        tracker: Tracker = part.guarded(part.build(stream(job.seed, "tracker")))
        found, true = list[Array](), list[Array]()
        with Episode(parse(self.driver, str(job.settings[WORLD]), self.benchmark)) as episode:
            _, region, start = episode.shown
            for step in episode:
                if step.frame.index == 0:
                    tracker.start(step.frame, region, start)
                else:
                    found.append(tracker.update(step.frame).outline(region))
                    true.append(step.truth.corners)
        off = np.linalg.norm(np.mean(found, axis=1) - np.mean(true, axis=1), axis=1)
        sizes = np.sqrt([area(corners) for corners in true])
        return {
            OVERLAP: float(turned_overlaps(np.stack(found), np.stack(true)).mean()),
            WITHIN: 100 * float(np.mean(off <= NEAR * sizes)),
        }


def errors_of(run: Columns, frames: int, what: WhatError) -> Array:
    """Return the error of the target's true place in each picture (frames,) [target sizes].

    It is infinite in pictures that the run did not reach, and where the target is behind the
    camera.

    Args:
        run: Columns of all steps of the run.
        frames: Number of pictures of a complete run.
        what: What the error covers. "centre": the distance in the picture of the target's centre
            from its goal, divided by the target's size, which is the square root of its area in the
            goal picture; "size": the larger of this distance and of the depth's error
            abs(ln(Z/Z*)) over 0.2; "all": the largest of these two and of the error of the target's
            angle over 15 degrees.
    """
    truth = run.first.truth
    metres = np.sqrt(area(truth.corners)) / truth.size
    parts = [run["servo"] / (metres * run["goal_size"])]
    if what != "centre":
        # The size in the picture is inversely proportional to the depth.
        parts.append(abs(np.log(run["size"] / run["goal_size"])) / EQUAL_DEPTH)
    if what == "all":
        angles = np.angle(np.exp(1j * run["turned"]), deg=True)
        parts.append(abs(angles) / EQUAL_DEG)
    found = np.full(frames, np.inf)
    found[: len(run)] = np.max(parts, axis=0)
    return np.where(np.isnan(found), np.inf, found)


def jobs_of(
    benchmark: Benchmark, contestants: Sequence[Contestant], worlds: Sequence[World]
) -> list[Job]:
    """Return a job for each contestant in each world (random scenario). In the worlds of the
    condition that `benchmark.slow` names, each contestant but the reference ones ("still" and
    "truth") also has a job for each time that a slowed tracker takes for a picture. In the first
    `benchmark.watched` worlds of each condition, the job of a contestant that is no reference and
    not slowed also runs it on the pictures of a camera that the reference "truth" steers.
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
                watches = is_ranked and ms == 0.0 and world.number < benchmark.watched
                driver = benchmark.table_of(world, benchmark.perfect or {}) if watches else None
                subject = WorldRun(
                    of, world.condition, benchmark.score, benchmark.error, table, driver
                )
                who: Table = {CONTESTANT: one.name, WORLD: world.key, SLOW: ms}
                found.append(Job(len(found), subject, world.seed, who))
    return found
