"""Whether the conditions of a draft of a benchmark part its contestants, on worlds to tune on:

    uv run python tests/benchmarks/pilot.py DRAFT ROWS.jsonl [worlds=N] [contestants=A,B] [conditions=C,D] [workers=N]

With a folder of published rows in place of ROWS.jsonl it prints the table of these, and runs nothing. Else it runs the contestants (by default all shipped ones) in the first N worlds of each condition (of all, or of those named), adds a line for each run
to ROWS.jsonl (runs that are there already are not repeated), and prints a table in Markdown. The rule, written before the
run: a condition is taken if the best contestant wins 40 to 70 % of its worlds, a camera that stands still under 5 %, and
the item-rest correlation (of a world's results with the contestants' share in all other worlds) is above .2 in 80 % of the
worlds that somebody, but not everybody, wins. Worlds of a condition are few here: the shares say what to change, and the
frozen benchmark is judged again by its own rows.
"""

import json
import sys
from pathlib import Path

import numpy as np

from servo.bench.benchmark import Band, condition_of, load
from servo.bench.contestant import contestants, scale_of
from servo.bench.row import rows_in
from servo.bench.score import RELATED, item_rest
from servo.bench.world_run import CONTESTANT, WORLD, jobs_of
from servo.bench.world_score import world_score
from servo.study.execute import Workers, execute
from servo.study.run import Failure


def run(
    draft: str, rows: Path, count: int, names: list[str], conditions: list[str], processes: int
) -> None:
    """Run what is missing in the file of rows, and add it."""
    benchmark = load(draft)
    done = {(row["world"], row["contestant"]) for row in read(rows)}
    worlds = [
        world
        for world in benchmark.every_world(Band(), count)
        if not conditions or world.condition in conditions
    ]
    every = [*scale_of(benchmark), *contestants(benchmark, names)]
    jobs = [
        job
        for job in jobs_of(benchmark, every, worlds)
        if (job.settings[WORLD], job.settings[CONTESTANT]) not in done
    ]
    # One world of each condition after the other, so that a pilot that is stopped is balanced.
    jobs.sort(key=lambda job: str(job.settings[WORLD]).rpartition("-")[2])
    with Workers(processes) as workers, rows.open("a") as file:
        for job, record in execute(jobs, workers):
            if isinstance(record, Failure):
                raise SystemExit(
                    f"{job.settings[WORLD]}, {job.settings[CONTESTANT]}: {record.reason}"
                )
            line = {
                "world": job.settings[WORLD],
                "contestant": job.settings[CONTESTANT],
                "won": world_score(benchmark.score, record).held,
                "mm": record.measures["end_position_mm"],
                "deg": record.measures["end_rotation_deg"],
            }
            file.write(json.dumps(line) + "\n")
            file.flush()


def read(rows: Path) -> list[dict[str, object]]:
    """The lines of a file of rows, or the results in a folder of published rows."""
    if rows.is_dir():
        return [
            {"world": world, "contestant": row.contestant, "won": score.held}
            for row in rows_in(rows.glob("*.json"))
            for world, score in row.worlds.items()
        ]
    return [json.loads(line) for line in rows.read_text().splitlines()] if rows.exists() else []


def table(rows: Path) -> str:
    """The table of a pilot: share of worlds won by condition and contestant, and the figures."""
    results = {(str(r["world"]), str(r["contestant"])): float(bool(r["won"])) for r in read(rows)}
    names = [*dict.fromkeys(name for _, name in results)]
    worlds = [*dict.fromkeys(world for world, _ in results)]
    whole = [w for w in worlds if all((w, name) in results for name in names)]
    methods = [name for name in names if name != "still"]
    won = np.array([[results[w, name] for w in whole] for name in methods])
    related = item_rest(won)
    head = ["condition", "worlds", *names, "worlds that part them", "item-rest above .2"]
    lines = ["| " + " | ".join(head) + " |", "|---" * len(head) + "|"]
    conditions = [*dict.fromkeys(condition_of(w) for w in whole)]
    for condition in [*conditions, "all of them"]:
        own = [condition in (condition_of(w), "all of them") for w in whole]
        shares = [
            np.mean([results[w, name] for w, is_own in zip(whole, own, strict=True) if is_own])
            for name in names
        ]
        parts = ~np.isnan(related[own])
        above = np.mean(related[own][parts] > RELATED) if parts.any() else np.nan
        cells = [condition, sum(own), *(f"{100 * s:.0f} %" for s in shares)]
        cells += [parts.sum(), f"{100 * above:.0f} %"]
        lines.append("| " + " | ".join(map(str, cells)) + " |")
    return "\n".join(lines)


if __name__ == "__main__":
    draft, path, *words = sys.argv[1:]
    options = dict(word.split("=", 1) for word in words)
    given = options.get("contestants", "")
    # Two networks of one tracker have a comma between them.
    chosen = given.split(";" if ";" in given else ",") if given else []
    some = options["conditions"].split(",") if "conditions" in options else []
    worlds = int(options.get("worlds", "6"))
    if not Path(path).is_dir():
        run(draft, Path(path), worlds, chosen, some, int(options.get("workers", "1")))
    sys.stdout.write(table(Path(path)) + "\n")
