"""How much a benchmark's scores depend on what should not matter: the seed of the runs, the renderer, the picture rate.

    uv run python tests/benchmarks/sensitivity.py BENCHMARK contestants=A,B [worlds=N] [workers=N]

Runs the contestants in the first N worlds to tune on of each condition, as they are and with each change of `CHANGES`, and
prints a table in Markdown: points of each contestant (0: `still`, 100: `truth`, both as they are), and Kendall's tau-b of
the contestants' order with that of the worlds as they are.
"""

import copy
import sys
from dataclasses import replace

import numpy as np
from scipy.stats import kendalltau

from servo.bench.benchmark import Band, load
from servo.bench.contestant import contestants, scale_of
from servo.bench.world_run import CONTESTANT, jobs_of
from servo.bench.world_score import world_score
from servo.scenario.toml import put
from servo.study.execute import Workers, execute
from servo.study.run import Failure

CHANGES = {
    "as they are": {},
    "other seed of the run": {"run.seed": 900_000},
    "OpenGL": {"camera.renderer": "opengl"},
    "15 Hz": {"camera.rate": 15.0},
    "60 Hz": {"camera.rate": 60.0},
}


def changed(job, changes):
    """Return a job with other settings of its world."""
    table = copy.deepcopy(job.subject.table)
    for key, value in changes.items():
        put(table, key, value, "sensitivity")
    return replace(job, subject=replace(job.subject, table=table, driver=None))


def main():
    """Run all, and print the table."""
    name, *words = sys.argv[1:]
    options = dict(word.split("=", 1) for word in words)
    benchmark = load(name)
    names = options["contestants"].split(",")
    worlds = benchmark.every_world(Band(), int(options.get("worlds", "1")))
    every = [*scale_of(benchmark), *contestants(benchmark, names)]
    points = {}
    ends = None
    with Workers(int(options.get("workers", "1"))) as workers:
        for title, changes in CHANGES.items():
            jobs = [changed(job, changes) for job in jobs_of(benchmark, every, worlds)]
            areas = {one.name: [] for one in every}
            for job, record in execute(jobs, workers):
                if isinstance(record, Failure):
                    sys.exit(record.reason)
                areas[job.settings[CONTESTANT]].append(world_score(benchmark.score, record).area)
            means = {one: float(np.mean(of)) for one, of in areas.items()}
            ends = ends or (means["still"], means["truth"])
            points[title] = {k: 100 * (v - ends[0]) / (ends[1] - ends[0]) for k, v in means.items()}
            sys.stderr.write(f"{title}\n")
    heads = ["truth", *names]
    print("| worlds | " + " | ".join(heads) + " | tau |")  # noqa: T201
    print("|---" * (len(heads) + 2) + "|")  # noqa: T201
    base = [points["as they are"][one] for one in names]
    for title, of in points.items():
        tau = kendalltau(base, [of[one] for one in names]).statistic
        cells = [f"{of[one]:.0f}" for one in heads]
        print(f"| {title} | " + " | ".join(cells) + f" | {tau:.2f} |")  # noqa: T201


if __name__ == "__main__":
    main()
