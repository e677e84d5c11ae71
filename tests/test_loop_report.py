"""A bench in the closed loop from made-up results: the printed table, its files, its page."""

import io

import numpy as np
import pytest
from rich.console import Console
from servo.bench.loop_jobs import LoopJob, LoopRun

from servo.bench import loop_jobs, suites
from servo.cli.terminal import print_table
from servo.report.bench_section import loop_table

WORDS = "mk_ssd,kams:paper"
COMMAND = f"servobench bench closed_loop --trackers {WORDS} --seeds 3"


def results():
    rng, found = np.random.default_rng(5), []
    for i, contender in enumerate(suites.contenders(WORDS)):
        for scenario in loop_jobs.SCENARIOS:
            for seed in range(3):
                rms, lost = float(rng.uniform(1, 3) * (1 + i)), i == 1 and seed == 2
                values = {
                    "servo_rms_px": rms,
                    "servo_peak_px": 3 * rms,
                    "tracking_rms_px": None if lost else rms / 2,
                    "track_ms": 0.5 + i,
                }
                outcome = "TARGET_LOST" if lost else "CONVERGED"
                follows = "x, y" + ", s" * i
                found.append(LoopRun(contender.label, follows, scenario, seed, outcome, values))
    return found


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Tables and bench.json, as the command leaves them."""
    monkeypatch.setattr(loop_jobs, "versions", lambda: {"servobench": "0.1.0"})
    loop_jobs.write(results(), tmp_path, COMMAND)
    return tmp_path


def test_the_table_is_printed_so(approved):
    console = Console(width=110, record=True, file=io.StringIO())
    print_table(console, loop_table(results()))
    approved("loop/printed", console.export_text().splitlines())


def test_the_page_says_and_draws_this(folder, section, approved):
    said = section(folder)
    assert said["blocks"][-1]["code"] == [COMMAND]
    approved("loop/page", said | {"title": ""})
    approved("loop/rows", (folder / "runs.csv").read_text().splitlines())


def test_a_job_names_all_that_decides_it(approved):
    job = LoopJob(suites.contenders("kams:paper")[0], "line", 2, ("run.duration=1.0",))
    assert job.key == "kams-paper/line-2"
    told = job.describe()
    assert told["scenario"]["run"]["duration"] == 1.0
    approved("loop/job", {"tracker": told["tracker"], "keys": sorted(told)})
