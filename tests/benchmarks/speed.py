"""Times of trackers, control law and loop: `uv run python tests/benchmarks/speed.py` prints a table.

They are medians over rendered frames, on one thread.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from math import atan, degrees
from pathlib import Path
from statistics import median
from time import perf_counter, process_time
from typing import Any

import cv2
import numpy as np
from rich.console import Console

from servo.cli.terminal import plain, print_table
from servo.loop.episode import Episode
from servo.loop.step import Seconds, Step
from servo.output.run_folder import RECORDING, RunFolder
from servo.report.words import Table
from servo.scenario.load import load
from servo.sight.estimate_to_sight import EstimateToSight
from sim.types import Frame
from tracking.trackers import KINDS as TRACKERS
from tracking.types import Region, State

CAR_LENGTH = 0.2
"""Length of the target's reference rectangle [m]."""
ROUNDS = 100
"""Pictures that rendering alone is timed on."""
WARM = 5
"""Number of first frames that do not count, because caches are still empty."""


LENGTH = 60.0
"""The car's length in the films that trackers are timed on [px]."""
TIMED = (
    "camshift",
    "cv_mean_shift",
    "mean_shift",
    "mk_ssd",
    "pf_ssd",
    "condensation",
    "annealed",
    "mk_pf",
    "kams",
    "cv_mil",
)
UNIT = "camshift"
"""Tracker times are given as multiples of OpenCV's."""


@dataclass(frozen=True, slots=True)
class Film:
    """Frames of the driving car from a camera at rest, with its place in the first frame."""

    frames: tuple[Frame, ...]
    region: Region
    state: State


def film(length: float, width: int = 320, frames: int = 40) -> Film:
    """A film with a car of this length [px], half as wide, in images of this width [px]."""
    height = width * 3 // 4
    focal = length / CAR_LENGTH  # at the goal's depth of 1 m
    changes = [
        "controller.kind=hold",
        "motion.x=-0.05",
        f"run.duration={frames / 30}",
        f"camera.width={width}",
        f"camera.height={height}",
        f"camera.fovy_deg={degrees(2 * atan(height / 2 / focal))}",
    ]
    with Episode(load("line", changes)) as episode:
        steps = list(episode)
    first = steps[0]
    return Film(tuple(s.frame for s in steps), first.region, first.true_state)


def tracker_ms(kind: str, film: Film, **settings: Any) -> float:
    """Median time of a tracker's update on a film [ms]."""
    config = TRACKERS.config(kind, **settings)
    tracker = config.build(np.random.default_rng(0))
    tracker.start(film.frames[0], film.region, film.state)
    return _median_ms([lambda f=f: tracker.update(f) for f in film.frames[1:]])


def law_ms(estimator: str = "kalman_cv", rounds: int = 10) -> float:
    """Median time of features, control law and estimator together over a run's steps [ms]."""
    with Episode(load("line", ["run.duration=1.0", f"estimator.kind={estimator}"])) as episode:
        steps = list(episode)
        dt = episode.world.period
        scene = steps[0].scene
        to_sight = EstimateToSight(
            episode.scenario.sight, scene.camera, scene.region, scene.outline
        )

        def think(step: Step) -> None:
            seen = to_sight.see(step.estimate, step.posture)
            episode.loop.law.controller.command(seen, step.posture, dt)

        return _median_ms([lambda s=step: think(s) for step in steps * rounds])


@dataclass(frozen=True, slots=True)
class LoopTimes:
    """Medians over the steps of one run [ms]."""

    step: float
    """Time from frame to frame, with everything."""
    cpu: float
    """Time of all threads from frame to frame."""
    render: float
    track: float
    control: float
    physics: float


def loop_times(changes: tuple[str, ...] = ()) -> LoopTimes:
    """Times of the scenario `line` with changes, as for --set."""
    with Episode(load("line", ["run.duration=4.0", *changes])) as episode:
        return times_of(episode)


def times_of(episode: Episode, add: Callable[[Step], None] | None = None) -> LoopTimes:
    """Times of a new episode, with `add` called for each step, such as that of a recording."""
    stages: list[Seconds] = []
    walls: list[float] = []
    cpus: list[float] = []
    cpu = process_time()
    began = perf_counter()
    for step in episode:
        if add is not None:
            add(step)
        walls.append(perf_counter() - began)
        cpus.append(process_time() - cpu)
        stages.append(step.seconds)
        cpu = process_time()
        began = perf_counter()
    each = (
        1e3 * median(getattr(s, name) for s in stages[WARM:])
        for name in ("render", "track", "control", "physics")
    )
    return LoopTimes(1e3 * median(walls[WARM:]), 1e3 * median(cpus[WARM:]), *each)


def rendering() -> tuple[float, float]:
    """Time of a picture alone, and its CPU time [ms]."""
    with Episode(load("line")) as episode:
        world = episode.world
        pictures = [world.look] * ROUNDS
        cpu = process_time()
        wall = _median_ms(pictures)
        return wall, 1e3 * (process_time() - cpu) / ROUNDS


def _median_ms(calls: list[Callable[[], Any]]) -> float:
    """Median time of calls without the first `WARM` [ms]."""
    times: list[float] = []
    for call in calls:
        began = perf_counter()
        call()
        times.append(perf_counter() - began)
    return 1e3 * median(times[WARM:])


def recorded() -> tuple[LoopTimes, float]:
    """Times of a loop that writes everything, and the size of its recording a frame [bytes]."""
    with tempfile.TemporaryDirectory() as folder:
        with Episode(load("line")) as episode:
            output = RunFolder(Path(folder), episode, rerun=True)
            times = times_of(episode, output.add)
            output.close()
        return times, (Path(folder) / RECORDING).stat().st_size / episode.frames


def main() -> None:
    """Print the table of this machine, after half a minute."""
    console = Console()
    alone, alone_cpu = rendering()
    loop = loop_times()
    with_recording, size = recorded()
    law = law_ms()
    cv2.setNumThreads(1)
    shown = film(LENGTH)
    times = {kind: tracker_ms(kind, shown) for kind in TIMED}
    more = with_recording.step / loop.step
    rows = [
        ["render", f"{alone:.2f}"],
        ["step (line, pf_ssd)", f"{loop.step:.2f}", "render", f"{loop.step / alone:.2f}"],
        ["CPU of a step", f"{loop.cpu:.2f}", "of rendering", f"{loop.cpu / alone_cpu:.2f}"],
        ["step with a recording", f"{with_recording.step:.2f}", "without", f"{more:.2f}"],
        ["features, control law, Kalman filter", f"{law:.3f}"],
        *(
            [f"{kind}, car of 60 x 30 px", f"{ms:.2f}", UNIT, f"{ms / times[UNIT]:.1f}"]
            for kind, ms in times.items()
        ),
    ]
    plain(console, "Medians in ms, 320 x 240")
    print_table(console, Table(("what", "ms", "against", "times"), rows, words=(0, 2)))
    plain(console, f"a recording has {size / 1e3:.1f} kB a frame")


if __name__ == "__main__":
    main()
