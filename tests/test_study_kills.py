"""Nothing is lost: workers, scheduler and client are killed in mid-study, and it goes on."""

import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from servo.farm import carry_out, farm
from servo.study import command, store
from servo.study.parse import load
from servo.study.perform import TIMED, perform

BIN = Path(sys.executable).parent
MINE = """# mine
# Short runs, of kinds that are quick to import.
scenario = "still"
seeds = 6

[set]
run.duration = 0.7
tracker.kind = "frozen"
estimator.kind = "none"

[axes]
run.latency = [0, 1]
start.x = { uniform = [-20.0, 20.0] }
"""
RUNS = 12
PATIENCE = 180.0
"""No step of these tests takes longer [s]."""


@pytest.fixture
def place(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").write_text(MINE)
    return tmp_path


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    """The table of all runs, done one after the other in this process, the last one first."""
    there = tmp_path_factory.mktemp("undisturbed")
    (there / "mine.toml").write_text(MINE)
    study = load(str(there / "mine.toml"))
    with store.Store(there / "out", study, command.manifest(study, "")) as kept:
        for run in reversed(list(study.runs())):
            kept.add(perform(run))
        return kept.table(kept.done()).drop_columns(TIMED)


def sweep(*options):
    words = [BIN / "servobench", "sweep", "mine.toml", "--out", "out", "-q", *options]
    # What a shell runs in its background, these tests perhaps, ignores Ctrl-C: not this.
    return subprocess.Popen(
        words, stderr=subprocess.PIPE, text=True, start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )  # fmt: skip


def finished():
    return len(list(Path("out/runs").glob("*.parquet")))


def wait_for_some(client, count=2):
    """In mid-study: some runs are finished, and some are not."""
    until = time.monotonic() + PATIENCE
    while finished() < count and time.monotonic() < until and client.poll() is None:
        time.sleep(0.02)
    assert count <= finished() < RUNS


def ended(client):
    _, said = client.communicate(timeout=PATIENCE)
    return client.returncode, said


def same_as(undisturbed):
    return pq.read_table("out/results.parquet").drop_columns(TIMED).equals(undisturbed)


def children_of(pid):
    """Processes whose parent this is, by what they were started with."""
    found = {}
    for status in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = status.read_text().rsplit(")", 1)[1].split()
            if int(fields[1]) == pid:
                found[int(status.parent.name)] = (status.parent / "cmdline").read_text()
        except OSError:
            continue
    return found


def test_a_killed_worker_and_a_killed_client_cost_nothing(place, undisturbed):
    client = sweep()
    wait_for_some(client)
    workers = [pid for pid, words in children_of(client.pid).items() if "spawn_main" in words]
    os.kill(workers[0], signal.SIGKILL)
    wait_for_some(client, finished() + 2)
    client.kill()
    client.communicate()
    before = {path: path.stat().st_mtime_ns for path in Path("out/runs").glob("*.parquet")}
    assert len(before) < RUNS
    assert ended(sweep("--workers", "1")) == (0, "")
    assert {path: path.stat().st_mtime_ns for path in before} == before  # none was run again
    assert same_as(undisturbed)


def test_ctrl_c_stops_cleanly_and_says_how_to_go_on(place):
    client = sweep("--seeds", "60")  # so many that it cannot be done before it hears
    wait_for_some(client)
    os.killpg(client.pid, signal.SIGINT)  # as a terminal does: to everybody
    assert ended(client) == (
        130,
        "servobench: stopped; what was written is complete up to here. "
        f"{finished()} of 120 runs are finished; go on with: "
        "servobench sweep mine.toml --seeds 60 --out out\n",
    )
    assert not list(Path("out/runs").glob(".*.part"))


@pytest.fixture
def cluster():
    """Starts a scheduler with two workers on this machine; gives it, and its address."""
    started = []

    def start():
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            port = probe.getsockname()[1]
        address = f"tcp://127.0.0.1:{port}"
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        one = [BIN / "dask", "worker", address, "--nthreads", "1", "--no-dashboard"]
        scheduler = [BIN / "dask", "scheduler", "--host", "127.0.0.1", "--port", str(port)]
        begun = [subprocess.Popen([*scheduler, "--no-dashboard"], **quiet)]
        begun += [subprocess.Popen(one, **quiet) for _ in range(2)]
        started.extend(begun)
        return begun[0], address

    yield start
    for process in started:
        process.terminate()
    for process in started:
        process.wait(PATIENCE)


def test_on_a_cluster_of_ones_own_a_killed_scheduler_costs_nothing(place, undisturbed, cluster):
    scheduler, address = cluster()
    client = sweep("--scheduler", address)
    wait_for_some(client)
    scheduler.kill()
    assert ended(client) == (
        2,
        f"servobench: the scheduler {address} is gone; {finished()} of {RUNS} runs are finished; "
        "go on with: servobench sweep mine.toml --out out\n",
    )
    assert ended(sweep("--workers", "1")) == (0, "")
    assert same_as(undisturbed)


def test_a_task_that_kills_its_workers_or_raises_does_not_stop_the_others():
    def work(task):
        import os

        if task == "deadly":
            os.kill(os.getpid(), 9)
        if task == "wrong":
            raise ValueError("this run is wrong")
        return task.upper()

    tasks = ["a", "deadly", "b", "wrong", "c", "d"]
    with farm(2, None) as client:
        found = dict(carry_out(client, tasks, work))
    assert {task: found[task].value for task in "abcd"} == {t: t.upper() for t in "abcd"}
    assert found["deadly"].error == (
        "3 workers died of it, one after the other: for want of memory, or somebody killed them\n"
    )
    assert found["wrong"].error.endswith("ValueError: this run is wrong\n")
    assert "in work" in found["wrong"].error


def test_workers_with_several_threads_are_refused(place):
    from distributed import LocalCluster

    with LocalCluster(n_workers=1, threads_per_worker=2, dashboard_address=None) as shared:
        address = shared.scheduler_address
        assert ended(sweep("--scheduler", address)) == (
            2,
            f"servobench: --scheduler {address}: a worker has several threads, but a renderer "
            "needs a process of its own; start the workers with --nthreads 1\n",
        )
