"""Ctrl-C means the same to every command, at any moment: one line, and exit code 130."""

import os
import signal
import sys

import pytest
from commands import STOPPED, begin, ended, wait_for, workers_of

from servo.cli import list_command, main

pytestmark = pytest.mark.processes


def test_a_command_that_does_nothing_about_it(monkeypatch, capfd):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(list_command, "shipped", interrupted)
    monkeypatch.setattr(sys, "argv", ["servobench", "list"])
    with pytest.raises(SystemExit) as ended:
        main.main()
    assert (ended.value.code, *capfd.readouterr()) == (130, "", f"{STOPPED}\n")


def test_a_bench_whose_workers_still_start(tmp_path):
    """One at work is stopped in `test_kills.py`, as a sweep is."""
    words = "evaluate clutter --trackers sok --seeds 300 --workers 2 --out out --quiet"
    bench = begin(words, tmp_path)
    wait_for(lambda: len(workers_of(bench)) == 2)
    os.killpg(bench.pid, signal.SIGINT)  # as a terminal does: to everybody
    assert ended(bench) == (
        130,
        f"{STOPPED} 0 of 1200 runs are finished; go on with: "
        "servobench evaluate clutter --trackers sok --seeds 300 --out out\n",
    )
    assert not (tmp_path / "out" / "table.csv").exists()  # of half the runs it would mislead
