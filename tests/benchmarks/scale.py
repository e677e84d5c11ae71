"""How large a study may be: `uv run python tests/benchmarks/scale.py [RUNS ...]`.

Puts made-up records of 1,000, 10,000 and 100,000 runs into a study's folder and prints, for each
step in a process of its own, time and peak memory: keeping them, finding them again, the tables of
`sweep`, and `report`.
"""

import multiprocessing
import resource
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from rich.console import Console

from servo.cli import sweep_command
from servo.study import store
from servo.study.parse import load
from servo.study.store import StudyFile

STUDY = """# mine
# Made up.
scenario = "still"
seeds = {seeds}
compare = "run.latency"

[set]
run.duration = 1.0
tracker.kind = "frozen"
estimator.kind = "none"

[axes]
run.latency = [0, 1, 2, 3]
controller.gain = [0.5, 1.0, 1.5, 2.0, 2.5]
start.x = {{ uniform = [-20.0, 20.0] }}
"""
CELLS = 20
SIZES = (1_000, 10_000, 100_000)


def first_records(folder):
    """Two real runs, one with a contact sheet; the client of a study does not render itself."""
    jobs = list(load(str(folder / "mine.toml")).jobs())[:2]
    return [job.run(folder) for job in jobs]


def made_up(job, records, rng):
    factor = rng.lognormal(0.0, 0.3)
    like = records[0 if job.pictured else 1]
    series = {
        name: values if values.dtype == bool else rng.normal(values, 1.0).astype(values.dtype)
        for name, values in like.series.items()
    }
    return replace(
        like,
        number=job.number,
        seed=job.seed,
        settings=job.settings,
        command=job.command,
        success=bool(factor < 1.2),
        measures={name: value * factor for name, value in like.measures.items()},
        series=series | {"time_s": like.series["time_s"]},
    )


def keep(folder, records):
    study = load(str(folder / "mine.toml"))
    rng = np.random.default_rng(0)
    with store.opened(folder / "out", StudyFile.of(study, "")) as kept:
        for job in study.jobs():
            kept.add(job, made_up(job, records, rng))
    return f"{(folder / 'out' / store.RUNS).stat().st_size / 1e6:.0f} MB"


def find(folder):
    study = load(str(folder / "mine.toml"))
    with store.opened(folder / "out", StudyFile.of(study, "")) as kept:
        kept.find(list(study.jobs()))
        return f"{len(kept.done)} finished"


def sum_up(folder):
    study = load(str(folder / "mine.toml"))
    with store.opened(folder / "out", StudyFile.of(study, "")) as kept:
        kept.find(list(study.jobs()))
        sweep_command._sum_up(study, kept, Console(quiet=True))
    return "with finding them"


def report(folder):
    from servo.cli.report_command import write  # `sweep` does not import what it needs

    return f"{write([folder / 'out'], None)[0].stat().st_size / 1e6:.1f} MB"


def timed(step, *given):
    began = time.perf_counter()
    found = step(*given)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    return time.perf_counter() - began, peak, found


def apart(step, *given):
    """What a step gives in a process of its own."""
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        return pool.apply(step, given)


def main(sizes):
    for runs in sizes:
        with tempfile.TemporaryDirectory() as there:
            folder = Path(there)
            (folder / "mine.toml").write_text(STUDY.format(seeds=runs // CELLS))
            records = apart(first_records, folder)
            for step, more in ((keep, [records]), (find, []), (sum_up, []), (report, [])):
                seconds, peak, found = apart(timed, step, folder, *more)
                each = f", {1e3 * seconds / runs:.2f} ms a run" if step is keep else ""
                sys.stdout.write(
                    f"{runs:7,} runs, {step.__name__:7s}{seconds:7.1f} s{each}, {peak:.0f} MB; "
                    f"{found}\n"
                )
                sys.stdout.flush()


if __name__ == "__main__":
    main([int(text) for text in sys.argv[1:]] or SIZES)
