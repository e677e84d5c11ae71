"""A bench in the closed loop from made-up results: the printed table, its files, its page."""

import io
import json

import numpy as np
import pytest
from rich.console import Console

from servo.batch.jobs import RESULTS
from servo.bench import loop_jobs, suites
from servo.bench.loop_jobs import LoopJob
from servo.cli import bench_loop_command

WORDS = "mk_ssd,kams:paper"


def results():
    rng, found = np.random.default_rng(5), []
    for i, contender in enumerate(suites.contenders(WORDS)):
        for scenario in loop_jobs.SCENARIOS:
            for seed in range(3):
                rms, lost = float(rng.uniform(1, 3) * (1 + i)), i == 1 and seed == 2
                values = {"servo_rms_px": rms, "servo_peak_px": 3 * rms,
                          "tracking_rms_px": None if lost else rms / 2,
                          "track_ms": 0.5 + i}  # fmt: skip
                outcome = "TARGET_LOST" if lost else "CONVERGED"
                found.append({"tracker": contender.label, "follows": "x, y" + ", s" * i,
                              "scenario": scenario, "seed": seed, "outcome": outcome,
                              "measures": values})  # fmt: skip
    return found


@pytest.fixture
def folder(tmp_path):
    """Results and bench.json, as the command leaves them."""
    loop_jobs.write(results(), tmp_path)
    for contender in suites.contenders(WORDS):
        for name in loop_jobs.SCENARIOS:
            for seed in range(3):
                path = tmp_path / RESULTS / contender.label / f"{name}-{seed}.json"
                path.parent.mkdir(parents=True, exist_ok=True)
                told = {"tracker": contender.describe(), "version": "0.1.0"}
                path.write_text(json.dumps({"job": told}))
    return tmp_path


def test_the_table_is_printed_so(approved):
    console = Console(width=110, record=True, file=io.StringIO())
    bench_loop_command._print(console, results())
    approved("loop/printed", console.export_text().splitlines())


def test_the_page_says_and_draws_this(folder, section, approved):
    said = section(folder)
    assert said["blocks"][-1]["code"] == [
        "servobench bench closed_loop --trackers mk_ssd,kams:paper --seeds 3"
    ]
    approved("loop/page", said | {"title": ""})
    approved("loop/rows", (folder / "runs.csv").read_text().splitlines())


@pytest.mark.parametrize("changed", ["gamma", "seed", "version"])
def test_a_command_is_named_only_where_it_repeats_the_bench(folder, section, changed):
    """Other settings of a tracker have no word on the command line, neither have odd seeds."""
    if changed == "gamma":
        for path in (folder / RESULTS).glob("kams*/*.json"):
            kept = json.loads(path.read_text())
            kept["job"]["tracker"]["settings"]["gamma"] = 3.0
            path.write_text(json.dumps(kept))
    elif changed == "seed":
        rows = [r for r in results() if r["seed"]]
        (folder / "bench.json").write_text(json.dumps({"runs": rows}))
    else:
        path = folder / RESULTS / "mk_ssd" / "still-0.json"
        path.write_text(path.read_text().replace("0.1.0", "0.0.9"))
    again = section(folder)["blocks"][-1]
    if changed == "version":
        assert [t["rows"] for t in again["tables"]] == [
            [["servobench", "0.0.9"]], [["servobench", "0.1.0"]],
        ]  # fmt: skip
    else:
        assert again["code"] == []
        assert again["text"] == [
            "Its trackers or sequences came from a file of your own; the settings of each run are "
            "in results/."
        ]


def test_a_job_names_all_that_decides_it(approved):
    job = LoopJob(suites.contenders("kams:paper")[0], "line", 2, ("run.duration=1.0",))
    assert job.key == "kams-paper/line-2"
    told = job.describe()
    assert told["scenario"]["run"]["duration"] == 1.0
    approved("loop/job", {"tracker": told["tracker"], "keys": sorted(told)})
