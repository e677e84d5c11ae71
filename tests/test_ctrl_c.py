"""Ctrl-C means the same to every command, at any moment: one line, and exit code 130."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from servo import catalogue, cli

STOPPED = "servobench: stopped; what was written is complete up to here."
SERVOBENCH = str(Path(sys.executable).parent / "servobench")
PATIENCE = 180.0
"""No step of these tests takes longer [s]."""


def test_a_command_that_does_nothing_about_it(monkeypatch, capfd):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(catalogue, "shipped", interrupted)
    monkeypatch.setattr(sys, "argv", ["servobench", "list"])
    with pytest.raises(SystemExit) as ended:
        cli.main()
    assert (ended.value.code, *capfd.readouterr()) == (130, "", f"{STOPPED}\n")


@pytest.mark.parametrize("results", [0, 1])
def test_a_bench_whose_workers_still_start_or_are_at_work(tmp_path, results):
    words = "bench clutter --trackers sok --seeds 300 --workers 2 --out out --quiet"
    with subprocess.Popen(
        [SERVOBENCH, *words.split()], cwd=tmp_path, start_new_session=True, preexec_fn=hear,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    ) as bench:  # fmt: skip
        wait_for(lambda: len(children(bench.pid)) >= 3)  # two workers and a tracker of resources
        wait_for(lambda: len(list(tmp_path.rglob("results/**/*.json"))) >= results)
        os.killpg(bench.pid, signal.SIGINT)  # as a terminal does: to everybody
        said = bench.communicate(timeout=PATIENCE)
    assert said == ("", f"{STOPPED} The same command goes on from there.\n")
    assert bench.returncode == 130
    assert not (tmp_path / "out" / "table.csv").exists()  # of half the runs it would mislead


def hear():
    """What a shell runs in its background, these tests perhaps, ignores Ctrl-C, and so would we."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def wait_for(condition):
    until = time.monotonic() + PATIENCE
    while not condition() and time.monotonic() < until:
        time.sleep(0.005)
    assert condition()


def children(pid):
    tasks = Path(f"/proc/{pid}/task").glob("*/children")
    return [child for task in tasks for child in task.read_text().split()]
