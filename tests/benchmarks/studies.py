"""What a study costs beside its runs: `uv run python tests/benchmarks/studies.py [memory]`.

Prints the gain of a second worker on `particles`, the share of time that is not inside runs, and
the memory over a thousand short runs; with `memory` that alone.
"""

import os
import sys
import tempfile
import time
from pathlib import Path

import psutil

from servo.study import store
from servo.study.cluster.local import local
from servo.study.cluster.tasks import carry_out
from servo.study.parse import load
from servo.study.store import StudyFile

MEGA = 2**20
SHORT = ["run.duration=0.2"]


def say(line):
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def timed(run):
    """A run's record, the seconds it took, and its worker with the memory it has then."""
    began = time.perf_counter()
    record = run.run(Path())
    return record, time.perf_counter() - began, os.getpid(), psutil.Process().memory_info().rss


def carried(study, workers, kept):
    """Wall-clock seconds, seconds inside runs, and memory [MB] of client and workers by run."""
    memory, inside = [], 0.0
    runs = list(study.jobs())
    with local(workers) as cluster:
        list(carry_out(cluster, runs[:workers], timed))  # imports, compiled loops
        began = time.perf_counter()
        for job, ended in carry_out(cluster, runs, timed):
            record, seconds, worker, rss = ended
            kept.add(job, record)
            inside += seconds
            memory.append((psutil.Process().memory_info().rss / MEGA, worker, rss / MEGA))
        return time.perf_counter() - began, inside, memory


def scaling(folder, seeds):
    study = load("particles", seeds=seeds)
    walls = {}
    for workers in (1, 2, 2, 1):
        place = folder / f"{workers}-{len(walls)}"
        with store.opened(place, StudyFile.of(study, "")) as kept:
            wall, inside, _ = carried(study, workers, kept)
        walls.setdefault(workers, []).append(wall)
        share = 100 * (1 - inside / (wall * workers))
        say(f"{workers} workers: {study.size} runs in {wall:.1f} s; not inside runs: {share:.1f} %")
    gain = min(walls[1]) / min(walls[2])
    say(f"two workers are {gain:.2f} times as fast as one")


def memory(folder, seeds):
    study = load("particles", SHORT, seeds)
    with store.opened(folder / "memory", StudyFile.of(study, "")) as kept:
        _, _, found = carried(study, 2, kept)
    workers = {worker for _, worker, _ in found}
    for count in (len(found) // 10, len(found) // 2, len(found)):
        held = {w: next(rss for _, v, rss in reversed(found[:count]) if v == w) for w in workers}
        told = ", ".join(f"{rss:.0f}" for rss in held.values())
        say(f"after {count} runs: client {found[count - 1][0]:.0f} MB, workers {told} MB")


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as there:
        if "memory" not in sys.argv:
            scaling(Path(there), 2)
        memory(Path(there), 72)
