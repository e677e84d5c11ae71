"""Tasks over workers, and `servobench check` by them: the same table, whatever fails."""

import json
import sys

import pytest

from servo.cli import main
from servo.study.cluster.local import local
from servo.study.cluster.remote import remote
from servo.study.cluster.tasks import carry_out
from servo.study.run import ClusterLost, Failure, Job
from servo.study.scenario_run import TIMES

pytestmark = pytest.mark.processes

QUICK = (
    "--set",
    "tracker.kind=frozen",
    "--set",
    "estimator.kind=none",
    "--set",
    "run.duration=0.3",
    "--set",
    "measure.after=0.0",
    "--set",
    "expect={servo_rms_px=0.5}",
    "--seeds",
    "2",
)


def call(monkeypatch, capfd, *arguments):
    """Exit code, stdout and stderr of a command."""
    monkeypatch.setattr(sys, "argv", ["servobench", *arguments])
    with pytest.raises(SystemExit) as ended:
        main.main()
    out, err = capfd.readouterr()
    return ended.value.code, out, err


def untimed(out):
    return [line.split()[:-2] for line in out.splitlines() if line]


def without_progress(err):
    """Without the lines that a check which takes a second writes of its progress."""
    return [line for line in err.splitlines() if not line.startswith("check: ")]


def test_table_measures_and_missed_bounds_are_the_same_on_one_worker_and_on_two(
    monkeypatch, capfd, tmp_path
):
    words = ("check", "still", "line", "still", *QUICK)
    one, two = (
        call(monkeypatch, capfd, *words, "--workers", n, "--json", str(tmp_path / f"{n}.json"))
        for n in "12"
    )
    assert one[0] == two[0] == 1
    assert untimed(one[1]) == untimed(two[1])
    assert one[1].startswith("check: 6 runs\n")
    _, _, *rows = untimed(one[1])
    assert [row[:2] for row in rows] == [
        [name, seed] for name in ("still", "line", "still") for seed in "01"
    ]
    assert without_progress(one[2]) == without_progress(two[2])
    assert one[2].count("missed: servo_rms_px is") == one[2].count("  again: servobench run") == 6
    here, there = (
        [
            {name: value for name, value in run["measures"].items() if name not in TIMES}
            for run in json.loads((tmp_path / f"{n}.json").read_text())["runs"]
        ]
        for n in "12"
    )
    assert here == there  # to the last bit


def test_a_run_that_fails_leaves_the_others(monkeypatch, capfd):
    real = Job.run

    def run(job, folder):
        if job.subject.name == "still":
            raise OSError("no luck")
        return real(job, folder)

    monkeypatch.setattr(Job, "run", run)
    words = ("check", "still", "line", *QUICK[:-2], "--set", "expect={}", "--workers", "1")
    code, out, err = call(monkeypatch, capfd, *words)
    again = (
        "servobench run still --set tracker.kind=frozen --set estimator.kind=none --set "
        "run.duration=0.3 --set measure.after=0.0 --set 'expect={servo_rms_px=0.5}' "
        "--set 'expect={}' "
        "--seed 0"
    )
    unjudged = "1 of 2 runs (line): No verdict: this scenario has no bounds.\n"
    failed = f"servobench: still failed: OSError: no luck\n  again: {again}\n"
    assert (code, err) == (1, unjudged + failed)
    assert out.startswith("check: 2 runs\n")
    assert [row[0] for row in untimed(out)[1:]] == ["scenario", "still", "line"]


@pytest.mark.usefixtures("no_progress")
def test_a_mistake_that_a_run_finds_is_said_once_and_exits_2(monkeypatch, capfd):
    words = ("check", "still", *QUICK, "--set", "start.x=200", "--set", "vary={}", "--workers", "1")
    code, out, err = call(monkeypatch, capfd, *words)
    assert (code, out.strip()) == (2, "check: 2 runs")
    assert err.startswith("servobench: still: first frame: the region spans ")
    assert err.count("\n") == 1


def test_how_a_task_ended_in_one_line():
    assert Failure("Traceback\n  in x\nValueError: so\n").reason == "ValueError: so"
    assert Failure("Traceback\nMistake: so\n", "so").reason == "so"


def test_a_task_that_kills_its_workers_or_raises_does_not_stop_the_others():
    def work(task):
        import os

        if task == "deadly":
            os.kill(os.getpid(), 9)
        if task == "wrong":
            raise ValueError("this run is wrong")
        return task.upper()

    tasks = ["a", "deadly", "b", "wrong", "c", "d"]
    with local(2) as cluster:
        found = dict(carry_out(cluster, tasks, work))
    assert {task: found[task] for task in "abcd"} == {t: t.upper() for t in "abcd"}
    assert found["deadly"].error == (
        "3 workers died during this task, one after the other: there is too little memory, or they "
        "were killed\n"
    )
    assert found["wrong"].reason == "ValueError: this run is wrong"
    assert "in work" in found["wrong"].error


def test_workers_with_several_threads_are_refused():
    from distributed import LocalCluster

    with LocalCluster(n_workers=1, threads_per_worker=2, dashboard_address="127.0.0.1:0") as shared:
        address = shared.scheduler_address
        with pytest.raises(ClusterLost) as refused, remote(address) as found:
            list(carry_out(found, [1], abs))
    assert str(refused.value) == (
        f"the scheduler {address}: a worker has several threads, but a renderer needs a process "
        "of its own; start the workers with --nthreads 1"
    )
