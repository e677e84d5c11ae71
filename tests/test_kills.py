"""Nothing is lost: commands, workers and schedulers are killed, stopped and continued at work."""

import os
import signal
import sys
import time
from contextlib import suppress
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from commands import (
    PATIENCE,
    QUICK,
    STOPPED,
    alive,
    begin,
    ended,
    frames_in,
    listening,
    wait_for,
    workers_of,
)

from servo.cli import main
from servo.mistake import Refused
from servo.study import store
from servo.study.parse import load
from servo.study.run import Job
from servo.study.scenario_run import TIMES
from servo.study.store import Store, StudyFile

pytestmark = pytest.mark.processes

MINE = """# mine
# Short runs, of kinds that are quick to import.
scenario = "still"
seeds = 12

[set]
run.duration = 0.7
tracker.kind = "frozen"
estimator.kind = "none"

[axes]
run.latency = [0, 1]
start.x = { uniform = [-20.0, 20.0] }
"""
RUNS = 24
SWEEP = "sweep mine.toml --out out -q"
TWO = "--workers 2"
run = Job.run
TERM, HUP, KILL = signal.SIGTERM, signal.SIGHUP, signal.SIGKILL
STOP, CONT = signal.SIGSTOP, signal.SIGCONT


@pytest.fixture
def place(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").write_text(MINE)
    return tmp_path


@pytest.fixture(scope="session")
def undisturbed(made_once):
    """The table of all runs, done one after the other in one process, the last one first."""

    def make(folder):
        (folder / "mine.toml").write_text(MINE)
        study = load(str(folder / "mine.toml"))
        with store.opened(folder / "out", StudyFile.of(study, "")) as kept:
            for run in reversed(list(study.jobs())):
                kept.add(run, run.run(kept.folder))
            pq.write_table(kept.table().drop_columns(TIMES), folder / "table.parquet")

    return pq.read_table(made_once("undisturbed", make) / "table.parquet")


def finished(folder="out"):
    """How many records there are."""
    there = Store(Path(folder))
    with suppress(Refused):  # the file is there, its table is not
        there.find()
    return len(there.done)


def wait_for_some(client, count=2):
    """In mid-study: some runs are finished, and some are not."""
    wait_for(lambda: finished() >= count or client.poll() is not None)
    assert count <= finished() < RUNS


def same_as(undisturbed):
    return pq.read_table("out/results.parquet").drop_columns(TIMES).equals(undisturbed)


def go_on(monkeypatch, words):
    """A command in this process; its exit code."""
    monkeypatch.setattr(sys, "argv", ["servobench", *words.split()])
    with pytest.raises(SystemExit) as left:
        main.main()
    return left.value.code


@pytest.mark.usefixtures("no_workers")
def test_a_killed_client_costs_nothing(place, undisturbed, monkeypatch):
    client = begin(f"{SWEEP} {TWO}")
    wait_for_some(client)
    client.kill()
    assert ended(client) == (-KILL, "")  # and no worker lives on
    before = finished()
    assert before < RUNS
    done = []
    monkeypatch.setattr(Job, "run", lambda job, to: done.append(job) or run(job, to))
    assert go_on(monkeypatch, SWEEP) == 0
    assert len(done) == RUNS - before  # none was run again
    assert same_as(undisturbed)


def test_a_sweep_stops_cleanly_says_how_to_go_on_and_listens_on_loopback_only(place):
    client = begin(f"{SWEEP} {TWO} --seeds 60")  # so many that it cannot be done before it hears
    wait_for_some(client)
    assert listening(alive(client.pid)) == {"0100007F"}
    os.killpg(client.pid, signal.SIGINT)  # as a terminal does: to everybody
    assert ended(client) == (
        128 + signal.SIGINT,
        f"{STOPPED} {finished()} of 120 runs are finished; go on with: "
        "servobench sweep mine.toml --seeds 60 --out out\n",
    )


def test_workers_that_are_killed_or_stopped_at_their_start_and_later_lose_nothing(
    place, undisturbed
):
    client = begin(f"{SWEEP} {TWO}")
    wait_for(lambda: len(workers_of(client)) == 2)
    for pid in workers_of(client):
        os.kill(pid, KILL)
    wait_for_some(client, 1)
    os.kill(workers_of(client)[0], KILL)
    wait_for_some(client, finished() + 2)
    workers = workers_of(client)
    for some in (workers[:1], workers, [client.pid]):
        for number in (STOP, CONT):
            for pid in some:
                os.kill(pid, number)
            time.sleep(0.1)
    assert ended(client) == (0, "")
    assert same_as(undisturbed)


@pytest.mark.usefixtures("no_workers")
def test_on_a_cluster_of_ones_own_nothing_that_dies_costs_anything(
    place, undisturbed, cluster, monkeypatch
):
    (scheduler, *workers), address = cluster(2)
    client = begin(f"{SWEEP} --scheduler {address}")
    wait_for_some(client, 1)
    for process in (scheduler, *workers):
        for number in (STOP, CONT):
            process.send_signal(number)
            time.sleep(0.1)
    workers[0].terminate()
    wait_for_some(client, finished() + 1)
    scheduler.kill()
    assert ended(client) == (
        2,
        f"servobench: the scheduler {address} is gone; only {finished()} of {RUNS} runs are finished; "
        "go on with: servobench sweep mine.toml --out out\n",
    )
    assert go_on(monkeypatch, SWEEP) == 0
    assert same_as(undisturbed)


def test_two_of_four_workers_of_a_cluster_may_die_at_work(place, undisturbed, cluster):
    from distributed import Client

    (_, *workers), address = cluster(4)
    with Client(address, set_as_default=False) as there:
        there.wait_for_workers(4, PATIENCE)
    client = begin(f"{SWEEP} --scheduler {address}")
    for worker in workers[:2]:
        wait_for_some(client, finished() + 2)
        worker.kill()
    assert ended(client) == (0, "")
    assert same_as(undisturbed)


BENCH = "evaluate clutter --trackers frozen --seeds 200 --out out"
BUSY = {
    "run": f"run still {QUICK} --set run.duration=600 --out out -q",
    "track": "track pictures --region 10,10,40,40 --tracker frozen --out out -q",
    "check": f"check still {QUICK} --set expect={{}} --seeds 900 -q {TWO}",
    "bench": f"{BENCH} -q {TWO}",
}
SIGNS = {"run": "out/steps.arrows", "track": "out/track.csv", "bench": "out/runs.sqlite"}


def at_work(name):
    """A command in the middle of its work."""
    if name == "track":
        Path("pictures").mkdir()
        first = Path("pictures/0.png")
        first.write_bytes(picture())
        for number in range(1, 20_000):
            os.link(first, f"pictures/{number}.png")
    client = begin(BUSY[name])
    if name == "check":  # it writes nothing
        wait_for(lambda: len(workers_of(client)) == 2)
    elif name == "run":  # its room on the disk is reserved before its rows
        wait_for(lambda: len(frames_in(Path(SIGNS[name]))) >= 30)
    else:
        wait_for(
            lambda: (
                finished()
                if name == "bench"
                else any(p.stat().st_size for p in Path().glob(SIGNS[name]))
            )
        )
    assert client.poll() is None
    return client


def picture():
    import cv2
    import numpy as np

    noise = np.random.default_rng(0).integers(0, 255, (120, 160, 3), np.uint8)
    return cv2.imencode(".png", noise)[1].tobytes()


@pytest.mark.parametrize(
    ("name", "number"), [("run", TERM), ("track", HUP), ("check", HUP), ("bench", TERM)]
)
def test_a_signal_ends_every_command_with_one_line_and_leaves_no_process(place, name, number):
    client = at_work(name)
    for other in (STOP, CONT):
        os.kill(client.pid, other)
    for _ in range(2):  # as `timeout` does
        os.killpg(client.pid, number)
    more = f" {finished()} of 800 runs are finished; go on with: servobench {BENCH}"
    assert ended(client) == (128 + number, f"{STOPPED}{more if name == 'bench' else ''}\n")
    assert not list(Path().glob("out/table.csv"))  # of half the runs it would mislead


SUITE = """
[[sequences]]
kind = "clutter"
level = "a"
frames = 40

[[trackers]]
kind = "sok"
"""


def test_a_killed_bench_goes_on_and_two_workers_find_what_one_finds(place, monkeypatch):
    Path("suite.toml").write_text(SUITE)
    words = "evaluate suite.toml --seeds 8 -q --out"
    client = begin(f"{words} two {TWO}")
    wait_for(lambda: finished("two") >= 2)
    client.kill()
    assert ended(client) == (-KILL, "")  # and no worker lives on
    for out in ("two", "one"):
        assert go_on(monkeypatch, f"{words} {out} --workers 1") == 0
    one, two = (untimed(Path(out) / "runs.csv") for out in ("one", "two"))
    assert one == two
    assert len(one) == 1 + 8


def untimed(path):
    """The lines of a table without its times."""
    import csv

    head, *rows = csv.reader(path.read_text().splitlines())
    timed = ("milliseconds", "auc_streamed")
    kept = [i for i, name in enumerate(head) if name not in timed]
    return [[row[i] for i in kept] for row in (head, *rows)]
